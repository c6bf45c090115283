"""Vibration: its laws against closed forms, and our own sketch at the other end of the line."""

import math
import random
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from needs import needs
from pydantic import ValidationError
from tactor_board import serial_board, udp_board
from virtual_sticks import desk

from labcrane import DeviceError, Feedback, Frame, Run, Signal, Tick
from labcrane.core import SessionState, Within
from labcrane.testing import TARGETS, FeedbackContract, ch8, main, make_run, make_target
from labcrane_sonification.settings import SonificationSettings
from labcrane_sphere.settings import SphereSettings
from labcrane_vibration import device
from labcrane_vibration.law import shares, strength
from labcrane_vibration.settings import VibrationSettings
from labcrane_vibration.vibration import Vibration

COMPASS = {"ahead": 0.0, "left": 90.0, "behind": 180.0, "right": -90.0}


class Noted(device.Device):
    """A device that notes what it is told."""

    soonest_s = 0.0

    def __init__(self, settings: VibrationSettings) -> None:
        super().__init__(len(settings.tactors), "noted")
        self.told: list[list[int]] = []

    def send(self, levels: list[int]) -> None:
        self.told.append(levels)


def settings(**keys: object) -> VibrationSettings:
    return VibrationSettings.model_validate({"port": "/dev/ttyACM0", **keys})


@pytest.fixture
def run() -> Run:
    return make_run(ch8(), task=TARGETS)


def vibrating(run: Run, **keys: object) -> Vibration:
    made = Vibration(settings(**keys), Noted)
    made.open(run)
    return made


def at(run: Run, way: tuple[float, float, float], due: float, **changes: object) -> Frame:
    """Return a frame in which the target is this way from the tip."""
    frame = make_target(run)
    frame.task[run.task.find("target.position")] = frame.state[run.state.find("tip.position")] + way
    frame.task[run.task.index("target.radius")] = 0.1
    return replace(frame, tick=Tick(round(due * run.rate_hz), due, due), **changes)


class TestVibration(FeedbackContract):
    """Offered as "vibration"."""

    @pytest.fixture
    def feedback(self) -> Feedback:
        return Vibration(settings(tactors=COMPASS), Noted)


def test_strength_and_pulses_change_evenly_with_distance_up_to_far() -> None:
    asked = settings(far=4.0, amplitude=[0.2, 0.6], pulse_hz=[1.0, 9.0])
    felt = [strength(asked, distance, 0.0) for distance in (0.0, 1.0, 3.0, 4.0, 40.0)]
    np.testing.assert_allclose(felt, [(0.6, 9), (0.5, 7), (0.3, 3), (0.2, 1), (0.2, 1)])


def test_a_tactor_is_given_the_cosine_of_its_angle_to_the_target() -> None:
    drawn = random.Random(5)
    asked = settings(tactors={**COMPASS, "seat": None}, aside=0.5)
    for _ in range(200):
        bearing, length = drawn.uniform(-math.pi, math.pi), drawn.uniform(0.5, 6.0)
        felt = shares(asked, length * math.cos(bearing), length * math.sin(bearing))
        angles = [bearing - math.radians(degrees) for degrees in COMPASS.values()]
        wanted = [math.cos(angle / 2.0) ** 2 for angle in angles]
        np.testing.assert_allclose(felt, [*wanted, 1.0], atol=1e-12)
    np.testing.assert_allclose(shares(asked, 0.0, 0.0), [0.5, 0.5, 0.5, 0.5, 1.0])


def test_pulses_are_on_for_half_of_the_time_and_begin_on(run: Run) -> None:
    made = vibrating(run, pulse_hz=[5.0, 5.0], amplitude=[0.5, 0.5])
    dues = np.arange(0.0, 2.0, 1.0 / run.rate_hz)
    levels = [made.present(at(run, (1.0, 0.0, 0.0), due))[2] for due in dues]
    on = [dues[0], *dues[1:][(np.diff(levels) > 0)]]
    np.testing.assert_allclose(on, np.arange(10) / 5.0, atol=2.1 / run.rate_hz)
    assert np.mean(np.array(levels) > 0.0) == pytest.approx(0.5, abs=0.02)


def test_its_intensity_follows_an_estimate_as_a_factor_of_the_amplitude() -> None:
    run = make_run(ch8(), axes=[Signal("estimate.load.ratio", "")], task=TARGETS)
    law = {"estimate": "load.ratio", "between": [1, 3], "to": [1, 0.5], "at_most_per_s": 0.5}
    made = vibrating(run, pulse_hz=None, amplitude=[0.8, 0.8], intensity=law)
    for elapsed, factor in ((0.0, 1.0), (0.5, 0.75), (2.0, 0.5)):
        frame = at(run, (1.0, 0.0, 0.0), elapsed, elapsed=elapsed)
        frame.axes[:] = 4.0
        amplitude, _, level, *_, recorded = made.present(frame)
        assert (amplitude, recorded) == pytest.approx((0.8 * factor, factor))
        assert level == pytest.approx(0.8 * factor, abs=0.01)


def test_inside_the_target_it_stops_after_a_moment_and_begins_again_outside(run: Run) -> None:
    made = vibrating(run, pulse_hz=None, silent_after_s=0.3)
    felt = [made.present(at(run, (x, 0, 0), due))[0] for x, due in (
        (0.05, 1.0), (0.05, 1.2), (0.05, 1.31), (0.2, 1.4), (0.05, 1.5)
    )]  # fmt: skip
    assert [value > 0.0 for value in felt] == [True, True, False, True, True]


def test_it_rests_between_trials_and_while_the_session_is_paused(run: Run) -> None:
    made = vibrating(run, pulse_hz=None)
    assert made.present(at(run, (1, 0, 0), 1.0))[2] > 0.0
    assert made.present(at(run, (1, 0, 0), 1.1, paused=True))[2] == 0.0
    assert made.present(at(run, (1, 0, 0), 1.2))[2] > 0.0
    assert math.isnan(made.present(at(run, (math.nan, 0, 0), 1.3))[1])
    made.present(at(run, (1, 0, 0), 1.4))
    made.idle()
    assert not any(made._open().levels)


def test_it_tells_what_the_tone_and_the_sphere_tell() -> None:
    distance = SphereSettings(far=3.0).reveals()
    assert settings(far=3.0, silent_after_s=None).reveals() == distance
    tone = set(SonificationSettings(far=3.0).reveals())
    assert set(settings(far=3.0, tactors={"left": 90, "right": -90}).reveals()) == tone
    all_round = set(settings(far=3.0, tactors=COMPASS).reveals())
    assert all_round - tone == {"whether the target is ahead or behind"}
    constant = settings(amplitude=[0.5, 0.5], pulse_hz=None, silent_after_s=None)
    assert constant.reveals() == ()
    assert settings(amplitude=[0, 0]).reveals() == ()
    assert Within("how far the tip is from the target", 4.0) in settings().reveals()


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"port": None}, "driver: serial needs port: write port: /dev/ttyACM0"),
        ({"driver": "udp"}, "driver: udp needs address: write address: 192.168.0.20:9000"),
        ({"driver": "rumble", "tactors": COMPASS}, "tactors are 4, and a controller has 2 motors"),
        ({"at_most": 0.5}, "amplitude goes up to 0.9, and at_most allows 0.5; lower the amplitude"),
    ],
)
def test_settings_that_cannot_be_met_are_refused(keys: dict, said: str) -> None:
    with pytest.raises(ValidationError, match=said):
        settings(**keys)


@pytest.mark.parametrize(
    ("keys", "key"),
    [
        ({"amplitude": [0, 0]}, "amplitude"),
        ({"amplitude": [0.4, 0.4], "pulse_hz": None}, "amplitude"),
        ({"pulse_hz": [1, 30]}, "pulse_hz"),
        ({"tactors": {"left": 90}}, "tactors"),
    ],
)
def test_check_asks_about_what_is_not_felt(keys: dict, key: str) -> None:
    assert set(settings(**keys).doubts(ch8())) == {key}
    assert not settings().doubts(ch8())
    by_side = settings(amplitude=[0.4, 0.4], pulse_hz=None, tactors={"left": 90, "right": -90})
    assert not by_side.doubts(ch8())


def test_above_the_minutes_of_a_session_it_stops_and_fails(run: Run) -> None:
    made = vibrating(run, minutes=0.1, pulse_hz=None)
    dues = np.arange(0.0, 7.0, 0.1)
    given = [made.present(at(run, (1, 0, 0), due))[-1] for due in dues[:61]]
    assert given[-1] == pytest.approx(6.0)
    with pytest.raises(DeviceError, match=r"was given 0\.1 minutes of vibration in this session"):
        made.present(at(run, (1, 0, 0), dues[61]))
    assert made._open().told[-1] == [0]  # type: ignore[attr-defined]
    again = vibrating(run, minutes=0.1, pulse_hz=None)  # a process that was started again
    with pytest.raises(DeviceError, match="after a restart, the whole time before it counts"):
        again.present(at(run, (1, 0, 0), 7.0))


def test_other_laws_are_taken_up_while_it_is_open(run: Run) -> None:
    made = vibrating(run, pulse_hz=None, amplitude=[0.2, 0.2])
    assert made.adjust(settings(pulse_hz=None, amplitude=[0.4, 0.4]))
    assert made.present(at(run, (1, 0, 0), 1.0))[0] == pytest.approx(0.4)
    assert not made.adjust(settings(tactors=COMPASS))


def test_a_preview_is_a_picture(run: Run, tmp_path: Path) -> None:
    frames = [at(run, (3.0 - due, 0, 0), due) for due in np.arange(0.0, 2.0, 0.05)]
    closed = Vibration(settings())
    closed.update(SessionState(trial=1, active=("pulse",)))
    (file,) = closed.preview(run, frames, tmp_path / "pulse")
    assert file.name == "pulse.png"
    assert file.read_bytes().startswith(b"\x89PNG")


BOARDS = [(serial_board, "port", "serial"), (udp_board, "address", "udp")]


def until(truth: Callable[[], bool], limit_s: float = 2.0) -> float:
    """Wait until something is so; return when it was."""
    deadline = time.monotonic() + limit_s
    while not truth():
        assert time.monotonic() < deadline, "it did not happen"
        time.sleep(0.005)
    return time.monotonic()


@needs("g++")
@pytest.mark.slow
@pytest.mark.parametrize(("board", "key", "driver"), BOARDS)
def test_a_board_does_and_answers_what_it_is_told(
    board: Callable, key: str, driver: str, run: Run, tmp_path: Path
) -> None:
    with board(tmp_path) as there:
        made = Vibration(settings(driver=driver, tactors=COMPASS, pulse_hz=None,
                                  **{key: there.address}))  # fmt: skip
        made.open(run)
        answered, told = {}, {}
        drawn = random.Random(2)
        for number in range(60):
            way = (drawn.uniform(-3, 3), drawn.uniform(-3, 3), 0.0)
            values = made.present(at(run, way, 0.02 * number))
            told[values[-2]] = values[2:6]
            time.sleep(0.015)

        def all_answered() -> bool:
            answered.update({number: delay for number, delay, _ in made.samples()["answer"]})
            return set(told) <= set(answered)

        until(all_answered)
        made.close()
        until(lambda: not there.vibrates())
        assert all(0.0 < delay < device.ANSWER_S for delay in answered.values())
        pins = {pin: [] for pin in (3, 5, 6, 9)}
        for _, pin, level in there.changes():
            pins[pin].append(level)
        for column, pin in enumerate((3, 5, 6, 9)):
            wanted = [round(255 * levels[column]) for levels in told.values()]
            changed = [b for a, b in zip([0, *wanted], wanted, strict=False) if a != b]
            assert [level for level in pins[pin] if level] == [level for level in changed if level]


@needs("g++")
@pytest.mark.slow
def test_a_board_stops_by_itself_when_nothing_is_said(run: Run, tmp_path: Path) -> None:
    with serial_board(tmp_path) as there:
        made = Vibration(settings(port=there.address, pulse_hz=None))
        made.open(run)
        made.present(at(run, (1, 0, 0), 0.0))
        until(there.vibrates)
        began = time.monotonic()
        stopped = until(lambda: not there.vibrates())
        assert 0.1 < stopped - began < 0.3
        made.close()


@needs("g++")
@pytest.mark.slow
def test_a_board_that_dies_is_lost_by_name(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(device, "ANSWER_S", 0.2)
    with serial_board(tmp_path) as there:
        made = Vibration(settings(port=there.address, pulse_hz=None))
        made.open(run)
        there.process.kill()
        said = f"the tactors at {there.address} are lost: they have not answered for 0.2 s"
        with pytest.raises(DeviceError, match=said):
            until(lambda: made.present(at(run, (1, 0, 0), 0.0)) is None)
        made.close()


def test_a_controller_rumbles_with_its_heavy_and_its_light_motor(run: Run) -> None:
    with desk() as table:
        stick = table.plug(motors=True)
        told = settings(driver="rumble").provides(ch8())["port"]
        assert told == ("controller 1",)
        made = Vibration(settings(driver="rumble", pulse_hz=None, amplitude=[0.8, 0.8],
                                  tactors={"left": 90, "right": -90}, aside=1.0))  # fmt: skip
        made.open(run)
        made.present(at(run, (0.0, 1.0, 0.0), 0.0))
        assert stick.rumbled[-1] == pytest.approx((0.8 * 65535, 0), abs=200)
        time.sleep(0.02)
        made.present(at(run, (0.0, -1.0, 0.0), 0.1))
        assert stick.rumbled[-1] == pytest.approx((0, 0.8 * 65535), abs=200)
        made.idle()
        assert stick.rumbled[-1] == (0, 0)
        assert not made.samples()
        time.sleep(0.02)
        made.present(at(run, (0.0, -1.0, 0.0), 0.15))
        until(lambda: stick.rumbled[-1] == (0, 0))  # a session that hangs gives no frame
        time.sleep(0.02)
        made.present(at(run, (0.0, -1.0, 0.0), 0.2))
        assert any(stick.rumbled[-1])
        made.close()
        assert stick.rumbled[-1] == (0, 0)


def test_a_controller_that_is_not_there_or_does_not_rumble_is_named(run: Run) -> None:
    with desk() as table:
        wanted = Vibration(settings(driver="rumble"))
        with pytest.raises(DeviceError, match="stick: 1 was asked for, and there are 0 contr"):
            wanted.open(run)
        table.plug(name="Dumb")
        with pytest.raises(DeviceError, match=r"controller 1 \(Dumb\) does not rumble; connect"):
            wanted.open(run)


@needs("g++")
@pytest.mark.slow
def test_a_board_with_fewer_tactors_is_refused_and_does_nothing_that_it_misread(
    run: Run, tmp_path: Path
) -> None:
    with serial_board(tmp_path) as there:
        made = Vibration(settings(port=there.address, tactors=dict.fromkeys("abcde")))
        with pytest.raises(DeviceError, match=r"names 5, and the board at .* has 4; name fewer"):
            made.open(run)
        made.close()
    with serial_board(tmp_path) as there:
        line = device.opened(settings(port=there.address))
        line.write(b"V 7 12128 0\n")
        line.write(b"E 1 " + 400 * b"9" + b" 4\n")
        line.set([0.5])
        until(there.vibrates)
        assert [level for _, _, level in there.changes()] == [128]
        line.close()


@needs("g++")
@pytest.mark.slow
def test_a_lost_datagram_does_not_lose_the_device(run: Run, tmp_path: Path) -> None:
    with udp_board(tmp_path) as there:
        line = device.opened(settings(driver="udp", address=there.address))
        line._times[line.number + 1] = time.perf_counter() - 5.0  # type: ignore[attr-defined]
        line.number += 1
        line.set([0.5])
        until(there.vibrates)
        line.close()


@needs("g++")
@pytest.mark.slow
def test_the_doctor_asks_the_board(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(device, "START_S", 0.3)
    with serial_board(tmp_path) as there:
        (found,) = device.examine(settings(port=there.address))
        assert "has 1 tactors; it answered within" in found.text
    (found,) = device.examine(settings(port="/dev/nowhere"))
    assert "the serial port '/dev/nowhere' cannot be opened" in found.text
    (found,) = device.examine(settings(driver="udp", address="127.0.0.1:9"))
    assert found.text == "the tactors at 127.0.0.1:9 do not answer"


EXAMPLE = Path(__file__).parents[2] / "examples" / "touch"


def test_the_example_gives_the_same_by_every_sense(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", str(EXAMPLE)]) == 0
    said = capsys.readouterr()
    assert "study 'touch' is fine" in said.out
    assert "warning" not in said.out + said.err
