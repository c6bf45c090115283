"""The lamp on a pseudo-terminal, as a serial port."""

import time

import pytest
from device import LampDevice
from labcrane_lamp import Lamp, LampSettings

from labcrane import DeviceError, Feedback
from labcrane.testing import TARGETS, FeedbackContract, ch8, make_run, make_target, opened


@pytest.fixture
def device() -> LampDevice:
    return LampDevice()


class TestLamp(FeedbackContract):
    @pytest.fixture
    def feedback(self, device: LampDevice) -> Feedback:
        return Lamp(LampSettings(port=device.port))


def test_light_and_motor_follow_the_distance(device: LampDevice) -> None:
    run = make_run(ch8(), task=TARGETS)
    lamp = Lamp(LampSettings(port=device.port, far=2.0, shake_below=0.5))
    with opened(lamp, run):
        frame = make_target(run)
        target = frame.task[run.task.find("target.position")]
        tip = frame.state[run.state.find("tip.position")]
        for distance, expected in ((1.0, [0.5, 0.0]), (0.25, [0.875, 0.5]), (0.0, [1.0, 1.0])):
            tip[:] = target
            tip[2] += distance
            assert lamp.present(frame).tolist() == pytest.approx(expected)
        assert lamp.metadata() == {"device": "lamp 1.2"}
    deadline = time.monotonic() + 5.0
    while len(device.motor) < 4 and time.monotonic() < deadline:
        time.sleep(0.01)  # another thread reads the line
    assert device.light == [128, 223, 255, 0]  # and dark when it is closed
    assert device.motor == [0, 128, 255, 0]


def test_the_distance_is_told_as_far_as_light_or_motor_follows_it() -> None:
    for far, shake_below, told in ((4.0, 0.5, "up to 4 m"), (0.5, 1.0, "up to 1 m")):
        (fact,) = LampSettings(port="COM3", far=far, shake_below=shake_below).reveals()
        assert str(fact) == f"how far the tip is from the target, {told}"


def test_something_else_on_the_port_is_refused() -> None:
    modem = LampDevice(name="AT")
    lamp = Lamp(LampSettings(port=modem.port))
    with pytest.raises(DeviceError, match="is not a lamp: it answered 'AT'; check port:"):
        lamp.open(make_run(ch8(), task=TARGETS))
    lamp.close()


def test_no_such_port_is_told() -> None:
    lamp = Lamp(LampSettings(port="/dev/no-such-port"))
    with pytest.raises(DeviceError, match=r"no lamp on /dev/no-such-port: .* check the cable"):
        lamp.open(make_run(ch8(), task=TARGETS))
    lamp.close()
