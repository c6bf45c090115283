"""Which stick is the left one, where its axes end, and the file that keeps it."""

from collections import deque
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from virtual_sticks import MODEL, VirtualStick, both, read

from labcrane import DeviceError
from labcrane.testing import ch8, make_run, opened
from labcrane_joystick.__main__ import set_up, wait_and_look
from labcrane_joystick.calibration import (
    AxisRange,
    Calibration,
    default_path,
    load,
    save,
)
from labcrane_joystick.dual_joystick import DualJoystick
from labcrane_joystick.procedure import calibrate, identify
from labcrane_joystick.settings import JoystickSettings
from labcrane_joystick.stick import attached


@pytest.fixture
def config(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("LABCRANE_CONFIG", str(tmp_path))
    return tmp_path / "joysticks.yaml"


def test_each_side_of_an_axis_is_linear_to_its_own_end():
    axis = AxisRange(minimum=-30000, centre=500, maximum=20000)
    for raw in range(-30000, 20001, 500):
        by_hand = np.interp(raw, [-30000, 500, 20000], [-1.0, 0.0, 1.0])
        assert axis.scaled(raw) == pytest.approx(by_hand, abs=1e-15)
    assert [axis.scaled(raw) for raw in (-30000, 500, 20000)] == [-1.0, 0.0, 1.0]
    assert (axis.scaled(-32768), axis.scaled(32767)) == (-1.0, 1.0)


def test_a_range_that_does_not_ascend_is_an_error_with_the_file(config):
    config.write_text(
        f"{MODEL}: {{date: '2025-01-31', left: {{port: a, x: {{minimum: 5, maximum: 3}}}}, "
        "right: {port: b}}\n",
        encoding="utf-8",
    )
    with pytest.raises(DeviceError, match="must ascend, but are 5, 0 and 3") as refused:
        load(config, MODEL)
    assert str(refused.value).startswith(f"{config}: the entry 044f:b10a is wrong at left.x")


@pytest.mark.parametrize("text", ["[1", "- a\n", "\x00"])
def test_a_file_that_cannot_be_read_is_an_error_with_its_path(config, text):
    config.write_text(text, encoding="utf-8")
    with pytest.raises(DeviceError, match="remove it and run 'python -m labcrane_joystick'") as bad:
        load(config, MODEL)
    assert str(config) in str(bad.value)


def test_a_file_that_cannot_be_written_is_an_error_that_says_where_else(tmp_path):
    (tmp_path / "full").mkdir()
    path = tmp_path / "full" / "joysticks.yaml"
    (tmp_path / "full" / "joysticks.yaml.new").mkdir()  # stands in for what nobody may write
    with pytest.raises(DeviceError, match="set LABCRANE_CONFIG to a folder that can") as bad:
        save(path, MODEL, both(Calibration(port="a"), Calibration(port="b")))
    assert str(bad.value).startswith(f"{path} cannot be written: Is a directory")


def test_what_is_kept_for_one_model_outlives_another(config):
    found = both(
        Calibration(port="a", x=AxisRange(minimum=-3, centre=1, maximum=2)), Calibration(port="b")
    )
    save(config, MODEL, found)
    save(config, "1234:5678", both(Calibration(port="c"), Calibration(port="d")))
    assert load(config, MODEL) == found
    assert load(config, "ffff:ffff") is None
    assert not list(config.parent.glob("*.new"))


def test_the_file_is_in_the_users_folder_unless_told(config, monkeypatch, tmp_path):
    assert default_path() == config
    monkeypatch.delenv("LABCRANE_CONFIG")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    assert default_path() == tmp_path / "home" / ".config" / "labcrane" / "joysticks.yaml"


class Hands:
    """Does one scripted thing before each look, as a person would between them."""

    def __init__(self, *moves: Callable[[], None]) -> None:
        self._moves = deque(moves)

    def look(self) -> None:
        import pygame

        assert self._moves, "the procedure waits for something the hands do not do"
        self._moves.popleft()()
        pygame.event.pump()


def pull(stick: VirtualStick) -> list[Callable[[], None]]:
    return [
        lambda: stick.press(down=False),
        lambda: stick.press(down=True),
    ]


def release(stick: VirtualStick) -> list[Callable[[], None]]:
    return [lambda: stick.press(down=False)]


def circle(stick: VirtualStick, low: int, rest: int, high: int) -> list[Callable[[], None]]:
    """Move every axis to both ends and let go; the slider stays at its upper end."""
    moves = [
        lambda axis=axis, raw=raw: stick.move(axis, raw)
        for axis in range(3)
        for raw in (low, high, rest)
    ]
    moves += [lambda: stick.move(3, low), lambda: stick.move(3, high)]
    return [*moves, *[lambda: None] * 100]


def test_the_stick_whose_trigger_is_pulled_is_the_left_one(table):
    first, second = table.plug(), table.plug()
    found = attached()
    left, right = identify(found, print, Hands(*pull(second)).look)
    assert (left.instance, right.instance) == (second.instance, first.instance)


def test_a_trigger_held_from_the_start_identifies_nothing(table):
    first, second = table.plug(), table.plug()
    first.press(down=True)
    found = attached()
    moves = [lambda: None, *pull(second), *release(first), *release(second), *pull(first)]
    left, _ = identify(found, print, Hands(*moves).look)
    assert left.instance == first.instance


def test_of_three_sticks_the_right_one_is_asked_for_too(table):
    first, _, third = table.plug(), table.plug(), table.plug()
    said: list[str] = []
    left, right = identify(attached(), said.append, Hands(*pull(third), *pull(first)).look)
    assert (left.instance, right.instance) == (third.instance, first.instance)
    assert said == [
        "pull the trigger of the LEFT stick",
        "pull the trigger of the RIGHT stick",
    ]


def test_what_the_procedure_finds_is_what_the_device_uses(table, config):
    first, second = table.plug(), table.plug()
    hands = Hands(
        *pull(second),
        *circle(second, -30000, 700, 28000),
        *pull(first),
        *release(second),
        *circle(first, -25000, -300, 31000),
        *pull(second),
    )
    said: list[str] = []
    set_up(JoystickSettings(), config, said.append, hands.look)
    assert said[-1] == f"stored in {config}"
    assert said[1].startswith("attached: Thrustmaster T.16000M (044f:b10a, 4 axes, 16 buttons)")
    assert "only their order tells left from right" in said[2]
    assert "  x: -30000 to 28000, at rest 700" in said
    assert "  slider: -25000 to 31000, at rest 3000" in said
    device = DualJoystick(JoystickSettings())
    with opened(device, make_run(ch8())):
        axes = read(device)
        assert [axes[f"left.{axis}"] for axis in ("x", "y", "twist", "slider")] == [0, 0, 0, 1]
        first.move(0, -25000)
        second.move(0, 28000)
        axes = read(device)
        assert (axes["left.x"], axes["right.x"]) == (1.0, -1.0)


def test_an_axis_not_moved_to_both_sides_is_refused_with_numbers(table):
    first, second = table.plug(), table.plug()
    moves = [*pull(first), lambda: first.move(0, 20000), lambda: first.move(0, 0), *pull(second)]
    with pytest.raises(DeviceError) as refused:
        calibrate(attached(), print, Hands(*moves).look, "2025-01-31")
    assert str(refused.value) == (
        "left x was moved from 0 to 20000 and rests at 0 (raw), but must move by 8192 at least "
        "to each side; start again and move it to both ends"
    )


def test_a_stick_unplugged_during_the_procedure_ends_it(table):
    stick = table.plug()
    assert attached()
    wait_and_look()
    stick.unplug()
    with pytest.raises(DeviceError, match="a joystick was unplugged"):
        wait_and_look()
