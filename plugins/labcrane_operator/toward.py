"""Hands that take the tip straight to the target, without a person's errors: an assistant."""

import numpy as np

from labcrane import FloatArray, Frame, InputDevice, Run, Signal, Tick, Trial
from labcrane.core import Phase
from labcrane_operator.settings import TowardSettings


class TowardTarget(InputDevice):
    """Asks the scheme for a tip velocity in proportion to the distance from the target.

    It depends on the frame before alone. Without a running trial and a target it asks for nothing.
    """

    def __init__(self, settings: TowardSettings) -> None:
        self.signals = tuple(Signal(name, "1") for name in settings.axes)
        self._gain = settings.gain_per_s
        self._trial = 0

    def open(self, run: Run) -> None:
        self._inverse = run.inverse
        self._tip = run.state.find("tip.position")
        # A task that shows nothing shows no target.
        self._target = run.task.find("target.position") if run.task.signals else None
        self._rest = np.zeros(len(self.signals))

    def begin_trial(self, trial: Trial) -> None:
        self._trial = trial.number

    def read(self, tick: Tick, seen: Frame) -> FloatArray:
        goes_on = seen.trial == self._trial and seen.phase is Phase.RUNNING and not seen.paused
        if self._target is None or not goes_on:
            return self._rest
        target = seen.task[self._target]
        if np.isnan(target).any():
            return self._rest
        return self._inverse(self._gain * (target - seen.state[self._tip]), seen.state)
