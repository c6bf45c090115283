"""Two schemes, and a button that changes between them."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from labcrane import Controller, FloatArray, Frame, Machine, Run, Signal, Trial
from labcrane.core import Kernel, Places, Sphere, Value
from labcrane_schemes.axis_map import find_axis
from labcrane_schemes.end_effector import EndEffector
from labcrane_schemes.joint_velocity import JointVelocity
from labcrane_schemes.law import BUTTON, BUTTON_SIGN, CHANGING, STEP, SWITCHES, kernel_of
from labcrane_schemes.settings import SwitchableSettings
from labcrane_schemes.signals import scheme_signals

PRESSED = 0.5
"""Value of a button above which it is down."""


class Switchable(Controller):
    """Joint-velocity or end-effector control, as the operator chooses during a trial.

    A change takes a while, in which the command is a mixture of what both schemes ask for: its
    share of the end effector's goes from 0 to 1 or back, so that no tick has a jump, and sticks
    that are let go of stop the machine at once. The tip's speed is by default that of the joints at
    the share of their speed that the other scheme has.
    """

    def __init__(self, settings: SwitchableSettings, machine: Machine) -> None:
        self.signals = (*scheme_signals(machine), Signal("scheme.active", "1"))
        self._schemes: tuple[JointVelocity, EndEffector] = (
            JointVelocity(settings.joint_velocity, machine),
            EndEffector(settings.end_effector, machine, settings.joint_velocity.speed),
        )
        self._button = settings.button
        self._start = 0 if settings.start == "joint_velocity" else 1
        self._active = self._start
        self._share = float(self._start)
        self._ramp_s = settings.ramp_s
        self._down = True
        self._out = np.zeros(sum(len(signal.columns) for signal in self.signals))

    def open(self, run: Run) -> None:
        self._index, self._sign = find_axis(run.axes, self._button)
        for scheme in self._schemes:
            scheme.open(run)
        self._step = 1.0 / max(1.0, self._ramp_s * run.rate_hz)

    def metadata(self) -> Mapping[str, Value]:
        _, tip = self._schemes
        return {f"end_effector.{name}": value for name, value in tip.metadata().items()}

    def attainable(self, places: Sequence[Sphere]) -> Mapping[str, float]:
        joints, tip = self._schemes
        return {**joints.attainable(places), **tip.attainable(places)}

    def begin_trial(self, trial: Trial) -> None:
        self._active = self._start
        self._share = float(self._start)
        self._down = True  # a button held since the last trial is not a new press

    def command(self, axes: FloatArray, state: FloatArray) -> FloatArray:
        down = self._sign * axes.item(self._index) > PRESSED
        if down and not self._down:
            self._active = 1 - self._active
        self._down = down
        step = self._step if self._active else -self._step
        self._share = share = min(1.0, max(0.0, self._share + step))
        joints, tip = self._schemes
        if share in {0.0, 1.0}:
            return self._with_active(self._schemes[self._active].command(axes, state))
        mixed = (1.0 - share) * joints.command(axes, state) + share * tip.command(axes, state)
        return self._with_active(mixed)

    def idle(self) -> FloatArray:
        return self._with_active(self._schemes[self._active].idle()).copy()

    def inverse(self, velocity: FloatArray, state: FloatArray) -> FloatArray:
        return self._schemes[self._active].inverse(velocity, state)

    def _with_active(self, command: FloatArray) -> FloatArray:
        self._out[:-1] = command
        self._out[-1] = self._active
        return self._out

    def kernel(self) -> Kernel:
        first, second = self._schemes
        made = kernel_of(first.law, second.law)
        own = made.own
        own[SWITCHES], own[BUTTON], own[BUTTON_SIGN] = 1.0, self._index, self._sign
        own[STEP] = self._step
        return replace(
            made, changing=CHANGING, take_over=self._take_over, hand_back=self._hand_back
        )

    def _take_over(self, own: FloatArray, seen: Frame) -> bool:
        own[:3] = self._active, self._down, self._share
        return True

    def _hand_back(self, own: FloatArray, rows: FloatArray, places: Places) -> None:
        self._active, self._down, self._share = int(own[0]), bool(own[1]), float(own[2])
