"""Two joysticks, one in each hand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from labcrane import DeviceError, FloatArray, Frame, InputDevice, Run, Signal, Tick
from labcrane.core import Value
from labcrane_joystick import sdl
from labcrane_joystick.calibration import (
    RUN_AGAIN,
    AxisRange,
    Calibration,
    Calibrations,
    default_path,
    load,
)
from labcrane_joystick.kernel import smoothing
from labcrane_joystick.settings import AXES, PARTS, SIDES, JoystickSettings
from labcrane_joystick.stick import Stick, attached, matching, model_of, pair

if TYPE_CHECKING:
    from pygame.event import Event


class DualJoystick(InputDevice):
    """The two sticks of a model, each axis scaled by its calibration and otherwise unchanged.

    ``x`` is positive to the right, ``y`` towards the operator, as the stick reports them. The
    scheme applies dead zone and expo. All values of an unplugged stick are zero, also
    ``connected``. This is a fault until a stick of the model is plugged in again, at any socket; it
    replaces the missing side.
    """

    signals = tuple(Signal(side, "1", PARTS) for side in SIDES)

    def __init__(self, settings: JoystickSettings) -> None:
        self._model = settings.stick
        self._path = default_path()
        self._stored: Calibrations | None = None
        self._started = False
        self._sticks: list[Stick | None] = [None, None]
        self._ranges: list[tuple[AxisRange, ...]] = []
        self._known: set[int] = set()
        self._waiting: list[Stick] = []
        self._facts: dict[str, Value] = {}
        self._values = np.zeros(len(SIDES) * len(PARTS))

    def open(self, run: Run) -> None:
        self._stored = load(self._path, self._model)
        self._started = True
        sdl.start()
        import pygame  # noqa: PLC0415 - heavy, and must start as sdl.start has it

        # Bound here, because an import in every tick costs more than reading an axis.
        self._events = pygame.event.get
        self._added, self._removed = pygame.JOYDEVICEADDED, pygame.JOYDEVICEREMOVED
        sticks = attached()
        self._known = {stick.instance for stick in sticks}
        self._sticks = list(tell_apart(pair(sticks, self._model), self._stored))
        calibrations = self._calibrations()
        self._ranges = [calibration.axes for calibration in calibrations]
        self._facts = self._opened_with(calibrations)

    def read(self, tick: Tick, seen: Frame) -> FloatArray:
        for event in self._events():
            if event.type == self._added:
                self._plugged_in(event)
            elif event.type == self._removed:
                self._unplugged(event)
        values: list[float] = []
        for stick, ranges in zip(self._sticks, self._ranges, strict=True):
            if stick is None:
                values += [0.0] * len(PARTS)
            else:
                values += map(AxisRange.scaled, ranges, stick.raw())
                values += (stick.trigger(), 1.0)
        self._values[:] = values
        return self._values

    def close(self) -> None:
        self._sticks, self._waiting = [None, None], []
        if self._started:
            self._started = False
            sdl.stop()

    def metadata(self) -> Mapping[str, Value]:
        return self._facts

    def _unplugged(self, event: Event) -> None:
        gone = event.instance_id
        self._waiting = [stick for stick in self._waiting if stick.instance != gone]
        for side, stick in enumerate(self._sticks):
            if stick is not None and stick.instance == gone:
                # Its axes would read as zero from now on, without any notice.
                stick.joystick.quit()
                self._sticks[side] = None
        self._state_fault()

    def _plugged_in(self, event: Event) -> None:
        if model_of(event.guid) != self._model:
            return
        try:
            fresh = attached(self._known)
            self._known |= {stick.instance for stick in fresh}
            if None not in self._sticks:
                return  # a third one
            self._waiting += matching(fresh, self._model)
            self._fill_sides()
        except DeviceError as error:
            self._state_fault(str(error))
        else:
            self._state_fault()

    def _fill_sides(self) -> None:
        """Give the sticks that were plugged in to the sides that miss one."""
        missing = [side for side, stick in enumerate(self._sticks) if stick is None]
        if len(self._waiting) < len(missing):
            return  # two are missing, and one alone may be either
        taken = self._waiting[: len(missing)]
        if len(missing) == len(SIDES):
            taken = list(tell_apart(self._waiting, self._stored))
        for side, stick in zip(missing, taken, strict=True):
            self._sticks[side] = stick
        self._waiting = []

    def _state_fault(self, why: str = "") -> None:
        missing = [side for side, stick in zip(SIDES, self._sticks, strict=True) if stick is None]
        if not missing:
            self.fault = None
        elif len(missing) == 1:
            self.fault = f"the {missing[0]} joystick is unplugged; {why or 'plug it in again'}"
        else:
            self.fault = f"both joysticks are unplugged; {why or 'plug them in again'}"

    def _calibrations(self) -> tuple[Calibration, ...]:
        if self._stored is not None:
            return (self._stored.left, self._stored.right)
        return tuple(Calibration(port=stick.port) for stick in self._sticks if stick)

    def _opened_with(self, calibrations: Sequence[Calibration]) -> dict[str, Value]:
        facts: dict[str, Value] = {"model": self._model, **_origin(self._stored, self._path)}
        socketed = all(stick.has_socket for stick in self._sticks if stick)
        facts["told_apart"] = "by socket" if socketed else "by order"
        for side, stick, calibration in zip(SIDES, self._sticks, calibrations, strict=True):
            assert stick is not None  # noqa: S101 - open has just found both
            facts |= {
                f"{side}.name": stick.name,
                f"{side}.guid": stick.guid,
                f"{side}.instance": stick.instance,
                f"{side}.port": stick.port,
            }
            kernel = smoothing(stick.node)
            for name, axis, (fuzz, flat) in zip(AXES, calibration.axes, kernel, strict=True):
                facts |= {f"{side}.{name}.{key}": raw for key, raw in axis.model_dump().items()}
                facts |= {f"{side}.{name}.fuzz": fuzz, f"{side}.{name}.flat": flat}
        return facts


def tell_apart(sticks: Sequence[Stick], stored: Calibrations | None) -> tuple[Stick, Stick]:
    """Return the left and the right stick.

    Where they were identified, the socket decides, and sticks in other sockets are refused:
    they may be swapped. Where they never were, the first is taken for the left.
    """
    if stored is None:
        if len(sticks) == len(SIDES):
            return sticks[0], sticks[1]
        raise DeviceError(
            f"{len(sticks)} joysticks of the model are attached, and none is known as left or "
            f"right; {RUN_AGAIN}, or unplug all but two"
        )
    at = {stick.port: stick for stick in sticks}
    try:
        return at[stored.left.port], at[stored.right.port]
    except KeyError:
        raise DeviceError(
            f"the joysticks were identified at {stored.left.port!r} (left) and "
            f"{stored.right.port!r} (right), but are now at {' and '.join(map(repr, at))}; "
            f"plug them in where they were, or {RUN_AGAIN}"
        ) from None


def _origin(stored: Calibrations | None, path: Path) -> dict[str, Value]:
    if stored is None:
        return {
            "identified": "not identified: the first stick is used as the left one",
            "calibrated": "not calibrated: full range",
        }
    by = f"{stored.date}, {path.name}"
    return {"identified": f"by its trigger, {by}", "calibrated": by}
