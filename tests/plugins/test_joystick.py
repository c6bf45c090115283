"""Two sticks in the session process, from SDL's event queue to the axes of a frame."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from virtual_sticks import COLUMNS, MODEL, Desk, VirtualStick, both, open_fails, read

from labcrane import InputDevice
from labcrane.testing import InputContract, ch8, make_run, opened
from labcrane_joystick import labcrane_inputs
from labcrane_joystick.calibration import (
    AxisRange,
    Calibration,
    save,
)
from labcrane_joystick.dual_joystick import DualJoystick
from labcrane_joystick.settings import JoystickSettings
from labcrane_joystick.stick import attached, model_of


@pytest.fixture(autouse=True)
def config(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("LABCRANE_CONFIG", str(tmp_path))
    return tmp_path / "joysticks.yaml"


@pytest.fixture
def sticks(table: Desk) -> tuple[VirtualStick, VirtualStick]:
    return table.plug(), table.plug()


@pytest.fixture
def device(sticks: tuple[VirtualStick, VirtualStick]) -> InputDevice:
    return DualJoystick(JoystickSettings())


@pytest.fixture
def running(device: DualJoystick) -> Iterator[DualJoystick]:
    with opened(device, make_run(ch8(), axes=device.signals)):
        yield device


class TestDualJoystick(InputContract):
    """With two virtual sticks plugged in."""

    @pytest.fixture
    def device(self, sticks: tuple[VirtualStick, VirtualStick]) -> InputDevice:
        (offer,) = (offer for offer in labcrane_inputs() if offer.name == "dual_joystick")
        return offer.build(JoystickSettings(), ch8())


def ports() -> list[str]:
    return [stick.port for stick in attached()]


def test_every_axis_and_trigger_arrives_at_its_own_side(sticks, running):
    hands = dict(zip(("left", "right"), sticks, strict=True))
    sent = {}
    for i, (side, stick) in enumerate(hands.items()):
        for axis, name in enumerate(("x", "y", "twist", "slider")):
            raw = 1000 * (1 + axis + 4 * i) * (-1) ** axis
            stick.move(axis, raw)
            sent[f"{side}.{name}"] = raw / (32767 if raw > 0 else 32768)
        sent |= {f"{side}.trigger": float(i), f"{side}.connected": 1.0}
        stick.press(down=bool(i))
    assert read(running) == sent
    assert running.fault is None


def test_the_ends_of_the_raw_range_are_exactly_one(sticks, running):
    sticks[0].move(0, 32767)
    sticks[0].move(1, -32768)
    axes = read(running)
    assert (axes["left.x"], axes["left.y"]) == (1.0, -1.0)


def test_an_unplugged_stick_is_a_fault_and_reads_zero_in_the_same_tick(sticks, running):
    sticks[0].move(0, 30000)
    sticks[1].move(0, 16384)
    assert read(running)["left.x"] > 0.9
    sticks[0].unplug()
    axes = read(running)
    assert {axes[c] for c in COLUMNS if c.startswith("left.")} == {0.0}
    assert axes["right.x"] == 16384 / 32767
    assert axes["right.connected"] == 1.0
    assert running.fault == "the left joystick is unplugged; plug it in again"


def test_an_unplugged_stick_reads_zero_even_where_zero_is_not_its_centre(table, config):
    off = AxisRange(minimum=-30000, centre=2000, maximum=30000)
    table.plug()
    second = table.plug()
    left, right = ports()
    save(config, MODEL, both(Calibration(port=left), Calibration(port=right, x=off)))
    device = DualJoystick(JoystickSettings())
    with opened(device, make_run(ch8())):
        second.move(0, 2000)
        assert read(device)["right.x"] == 0.0
        second.unplug()
        assert read(device)["right.x"] == 0.0
        assert device.fault


def test_a_stick_plugged_in_again_takes_the_missing_side(table, sticks, running):
    sticks[0].unplug()
    read(running)
    again = table.plug()
    assert again.instance not in {stick.instance for stick in sticks}
    again.move(0, -32768)
    sticks[1].move(0, 32767)
    axes = read(running)
    assert running.fault is None
    assert (axes["left.x"], axes["left.connected"]) == (-1.0, 1.0)
    assert axes["right.x"] == 1.0


def test_unplugged_and_plugged_in_between_two_ticks_is_no_fault_after(table, sticks, running):
    sticks[1].unplug()
    again = table.plug()
    again.move(1, 32767)
    axes = read(running)
    assert running.fault is None
    assert axes["right.y"] == 1.0


def test_two_unplugged_sticks_come_back_when_both_are_there(table, sticks, running):
    for stick in sticks:
        stick.unplug()
    assert set(read(running).values()) == {0.0}
    assert running.fault == "both joysticks are unplugged; plug them in again"
    first = table.plug()
    assert read(running)["left.connected"] == 0.0
    assert running.fault
    first.unplug()
    read(running)
    again = table.plug(), table.plug()
    again[0].move(0, 32767)
    again[1].move(0, -32768)
    axes = read(running)
    assert running.fault is None
    assert (axes["left.x"], axes["right.x"]) == (1.0, -1.0)


def test_a_stick_of_another_model_takes_no_side(table, sticks, running):
    sticks[0].unplug()
    table.plug(name="Pad", model=(0x045E, 0x028E))
    assert read(running)["left.connected"] == 0.0
    assert running.fault


def test_a_third_stick_plugged_in_later_changes_nothing(table, sticks, running):
    third = table.plug()
    third.move(0, 32767)
    assert read(running)["left.x"] == read(running)["right.x"] == 0.0
    sticks[0].unplug()
    axes = read(running)
    assert axes["left.connected"] == 0.0
    assert running.fault


def test_a_broken_stick_plugged_in_is_named_by_the_fault(table, sticks, running):
    sticks[0].unplug()
    table.plug(axes=2)
    read(running)
    assert running.fault is not None
    assert "left joystick is unplugged" in running.fault
    assert "has 2 axes and 16 buttons" in running.fault


def test_a_storm_of_motion_does_not_hide_an_unplugging(sticks, running):
    import pygame

    for number in range(66_000):  # SDL's queue holds 65535, and drops what comes after
        sticks[0].move(0, number % 2)
        pygame.event.pump()
    sticks[1].unplug()
    read(running)
    assert running.fault


def test_another_model_can_be_asked_for(table):
    for _ in range(2):
        table.plug(name="Extreme 3D", model=(0x046D, 0xC215))
    device = DualJoystick(JoystickSettings(stick="046d:c215"))
    with opened(device, make_run(ch8())):
        assert read(device)["right.connected"] == 1.0


def test_what_was_identified_decides_which_stick_is_left(table, config):
    first, second = table.plug(), table.plug()
    one, two = ports()
    save(config, MODEL, both(Calibration(port=two), Calibration(port=one)))
    device = DualJoystick(JoystickSettings())
    with opened(device, make_run(ch8())):
        first.move(0, 32767)
        second.move(0, -32768)
        axes = read(device)
        assert (axes["left.x"], axes["right.x"]) == (-1.0, 1.0)
        assert device.metadata()["identified"] == "by its trigger, 2025-01-31, joysticks.yaml"
        assert device.metadata()["left.port"] == two
        # Both come back in the order of the first time, so the left is again the second.
        first.unplug()
        second.unplug()
        read(device)
        table.plug().move(0, 32767)
        table.plug().move(0, -32768)
        axes = read(device)
        assert device.fault is None
        assert (axes["left.x"], axes["right.x"]) == (-1.0, 1.0)


def test_sticks_in_other_sockets_than_identified_are_refused(table, config):
    for _ in range(2):
        table.plug()
    one, two = ports()
    save(config, MODEL, both(Calibration(port="left-socket"), Calibration(port=two)))
    assert open_fails() == (
        f"the joysticks were identified at 'left-socket' (left) and {two!r} (right), but are now "
        f"at {one!r} and {two!r}; plug them in where they were, or run 'python -m "
        "labcrane_joystick' to identify and calibrate the sticks"
    )


def test_facts_say_what_was_not_done(sticks, running):
    facts = running.metadata()
    assert facts["identified"] == "not identified: the first stick is used as the left one"
    assert facts["calibrated"] == "not calibrated: full range"
    assert facts["right.name"] == "Thrustmaster T.16000M"
    assert facts["right.instance"] == sticks[1].instance
    assert model_of(str(facts["right.guid"])) == MODEL
    assert (facts["left.x.minimum"], facts["left.x.centre"]) == (-32768, 0)
    assert facts["told_apart"] == "by order"
    assert facts["left.twist.fuzz"] == facts["left.twist.flat"] == "not read"


def test_a_calibration_is_applied_to_its_own_stick_and_recorded(table, config):
    first, second = table.plug(), table.plug()
    one, two = ports()
    y = AxisRange(minimum=-20000, centre=-1000, maximum=25000)
    save(config, MODEL, both(Calibration(port=one), Calibration(port=two, y=y)))
    device = DualJoystick(JoystickSettings())
    with opened(device, make_run(ch8())):
        first.move(1, 12000)
        second.move(1, 12000)
        axes = read(device)
        assert axes["left.y"] == 12000 / 32767
        assert axes["right.y"] == 13000 / 26000
        facts = device.metadata()
        assert [facts[f"right.y.{key}"] for key in ("minimum", "centre", "maximum")] == [
            -20000,
            -1000,
            25000,
        ]
