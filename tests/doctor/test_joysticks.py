"""The look at the joysticks, with virtual ones that are moved when the person is told to."""

from collections.abc import Callable
from pathlib import Path

import pygame
import pytest
from virtual_sticks import Desk, VirtualStick

from labcrane import Offer, Settings
from labcrane.core import Finding, Verdict
from labcrane.testing import ExaminationContract
from labcrane_joystick import labcrane_inputs
from labcrane_joystick.calibration import AxisRange, Calibration, Calibrations, save
from labcrane_joystick.examination import examine
from labcrane_joystick.settings import JoystickSettings
from labcrane_joystick.stick import attached

X, Y = 0, 1
FULL = 32000


class TestExamination(ExaminationContract):
    @pytest.fixture
    def offered(self) -> Offer:
        return labcrane_inputs()[0]

    @pytest.fixture
    def settings(self) -> Settings:
        return JoystickSettings()


@pytest.fixture(autouse=True)
def config(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LABCRANE_CONFIG", str(tmp_path))


class Person:
    """Does what the doctor says, while the clock goes on by as much as anybody waits."""

    def __init__(self, left: VirtualStick, right: VirtualStick, *, swapped: bool) -> None:
        self._sticks = (right, left) if swapped else (left, right)
        self._round: Callable[[int], None] | None = None
        self._now, self._looks = 0.0, 0
        self.told: list[str] = []

    def ask(self, text: str) -> None:
        self.told.append(text)
        stick = self._sticks["RIGHT stick" in text]
        self._round = None
        if text.startswith("push"):
            stick.move(X if "to the RIGHT" in text else Y, FULL)
        elif text == "let go of it":
            for each in self._sticks:
                each.move(X, 0)
                each.move(Y, 0)
        else:
            self._round = lambda look: stick.move(
                look // 8 % 2, (FULL if look // 16 % 2 else -FULL) + look % 8
            )

    def look(self, seconds: float) -> float:
        self._now += seconds
        self._looks += 1
        if self._round:
            self._round(self._looks)
        pygame.event.pump()
        return self._now


def looked_at(*sticks: VirtualStick, ask: bool = False, swapped: bool = False) -> list[Finding]:
    person = Person(sticks[0], sticks[1], swapped=swapped)
    return examine(JoystickSettings(), person.ask if ask else None, look=person.look)


def said(found: list[Finding], verdict: Verdict) -> list[str]:
    return [finding.text for finding in found if finding.verdict is verdict]


def identified(left: AxisRange | None = None) -> None:
    """Keep a calibration in which the sticks are where they are."""
    ports = [stick.port for stick in attached()]
    scale = left or AxisRange(minimum=-FULL, centre=0, maximum=FULL)
    first = Calibration(port=ports[0], x=scale)
    second = Calibration(port=ports[1])
    from labcrane_joystick.calibration import default_path

    save(default_path(), "044f:b10a", Calibrations(date="2026-01-02", left=first, right=second))


def test_sticks_that_are_not_there_are_named(table: Desk) -> None:
    table.plug()
    (found,) = examine(JoystickSettings(), None)
    assert found.verdict is Verdict.FAIL
    assert found.text.startswith("two joysticks 044f:b10a are needed, but 1 of that model is")
    assert found.advice.startswith("plug in two")


def test_without_a_person_the_rest_position_is_looked_at(table: Desk) -> None:
    found = looked_at(table.plug(), table.plug())
    assert "left x rests at +0.0 % of its range" in said(found, Verdict.PASS)
    warned = said(found, Verdict.WARN)
    assert "not identified" in warned[0]
    assert warned[-1].endswith("were not checked: no stick was moved")
    assert not said(found, Verdict.FAIL)


def test_a_stick_that_does_not_rest_in_its_centre_is_told(table: Desk) -> None:
    left, right = table.plug(), table.plug()
    left.move(X, 2000)  # 6.1 % of 32767
    right.move(Y, -FULL)
    found = looked_at(left, right)
    assert "left x rests at +6.1 % of its range" in said(found, Verdict.WARN)
    assert said(found, Verdict.FAIL) == ["right y rests at -97.7 % of its range"]


def test_a_calibrated_centre_counts(table: Desk) -> None:
    left, right = table.plug(), table.plug()
    identified(AxisRange(minimum=-FULL, centre=2000, maximum=FULL))
    left.move(X, 2000)
    assert "left x rests at +0.0 % of its range" in said(looked_at(left, right), Verdict.PASS)


def test_sticks_in_order_pass_every_movement(table: Desk) -> None:
    found = looked_at(table.plug(), table.plug(), ask=True)
    assert not said(found, Verdict.FAIL)
    passed = said(found, Verdict.PASS)
    assert "left x moves as it should" in passed
    assert "right y reaches -98 to +98 % of its range" in passed
    # One value a look, a look a millisecond.
    assert any(line.startswith("left stick gave 1000 new values a second") for line in passed)


def test_swapped_sticks_are_told(table: Desk) -> None:
    found = looked_at(table.plug(), table.plug(), ask=True, swapped=True)
    assert "left stick pushed to the right moved right x +" in said(found, Verdict.FAIL)


def test_a_stuck_axis_and_a_slow_stick_are_told(table: Desk) -> None:
    left, right = table.plug(), table.plug()
    move = right.move
    right.move = lambda axis, raw: None if axis == X else move(axis, raw)  # type: ignore[method-assign]
    found = looked_at(left, right, ask=True)
    assert "right x did not move" in said(found, Verdict.FAIL)
    assert "right x reaches +0 to +0 % of its range" in said(found, Verdict.FAIL)
    right.move = lambda axis, raw: None  # type: ignore[method-assign]
    found = looked_at(left, right, ask=True)
    assert "right stick gave 0 new values a second while it moved" in said(found, Verdict.WARN)
