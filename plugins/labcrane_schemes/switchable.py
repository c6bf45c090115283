"""Two schemes, and a button that changes between them."""

import numpy as np

from labcrane import Controller, FloatArray, Frame, Machine, Run, Signal, Trial
from labcrane.core import Places, Twin
from labcrane_schemes.axis_map import find_axis
from labcrane_schemes.end_effector import EndEffector
from labcrane_schemes.joint_velocity import JointVelocity
from labcrane_schemes.law import twin_numbers
from labcrane_schemes.settings import SwitchableSettings
from labcrane_schemes.signals import scheme_signals

PRESSED = 0.5
"""Value of a button above which it is down."""


class Switchable(Controller):
    """Joint-velocity or end-effector control, as the operator chooses during a trial."""

    def __init__(self, settings: SwitchableSettings, machine: Machine) -> None:
        self.signals = (*scheme_signals(machine), Signal("scheme.active", "1"))
        self._schemes: tuple[JointVelocity, EndEffector] = (
            JointVelocity(settings.joint_velocity, machine),
            EndEffector(settings.end_effector, machine),
        )
        self._button = settings.button
        self._start = 0 if settings.start == "joint_velocity" else 1
        self._active = self._start
        self._down = True
        self._out = np.zeros(sum(len(signal.columns) for signal in self.signals))

    def open(self, run: Run) -> None:
        self._index, self._sign = find_axis(run.axes, self._button)
        for scheme in self._schemes:
            scheme.open(run)

    def begin_trial(self, trial: Trial) -> None:
        self._active = self._start
        self._down = True  # a button still held from the last trial is no new press

    def command(self, axes: FloatArray, state: FloatArray) -> FloatArray:
        down = self._sign * axes.item(self._index) > PRESSED
        if down and not self._down:
            self._active = 1 - self._active
        self._down = down
        return self._with_active(self._schemes[self._active].command(axes, state))

    def idle(self) -> FloatArray:
        return self._with_active(self._schemes[self._active].idle()).copy()

    def inverse(self, velocity: FloatArray, state: FloatArray) -> FloatArray:
        return self._schemes[self._active].inverse(velocity, state)

    def _with_active(self, command: FloatArray) -> FloatArray:
        self._out[:-1] = command
        self._out[-1] = self._active
        return self._out

    def twin(self) -> Twin:
        from labcrane_schemes.compiled import (  # noqa: PLC0415 - loads numba
            BUTTON,
            BUTTON_SIGN,
            CHANGING,
            SWITCHES,
            command,
            hands,
        )

        first, second = self._schemes
        own = twin_numbers(first.law, second.law)
        own[SWITCHES], own[BUTTON], own[BUTTON_SIGN] = 1.0, self._index, self._sign
        return Twin(command, own, CHANGING, self._take_over, self._hand_back, inverse=hands)

    def _take_over(self, own: FloatArray, seen: Frame) -> bool:
        own[:2] = self._active, self._down
        return True

    def _hand_back(self, own: FloatArray, rows: FloatArray, places: Places) -> None:
        self._active, self._down = int(own[0]), bool(own[1])
