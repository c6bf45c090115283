"""my_part: a second task that runs beside any task."""

from collections.abc import Mapping

import numpy as np
from pydantic import PositiveFloat

from labcrane import Frame, Offer, Run, SecondaryTask, Settings, Signal, Trial, hookimpl, offer
from labcrane.core import AxisName, Phase, TrialStatus, Value

labcrane_api = 1


class MyPartSettings(Settings):
    """Settings of my_part; a protocol writes them next to ``use``."""

    axis: AxisName = "left.trigger"
    """Axis of the input that is to be pressed once in every period."""

    period_s: PositiveFloat = 2.0
    """Duration of a period, in seconds."""


class MyPart(SecondaryTask):
    """Counts the periods in which an axis was pressed."""

    # What happens every tick: cues and sounds present it, and it is recorded.
    signals = (Signal("period", "1"), Signal("pressed", "1"))
    # What a finished trial is measured by.
    results = (Signal("share", "1", definition="share of the whole periods with a press"),)

    def __init__(self, settings: MyPartSettings) -> None:
        self._settings = settings

    def open(self, run: Run) -> None:
        self._axis = run.axes.index(self._settings.axis)
        self._ticks_of_a_period = round(self._settings.period_s * run.rate_hz)

    def begin_trial(self, trial: Trial) -> None:
        # Draw what is random from trial.seed only.
        self._ticks, self._pressed = 0, set[int]()

    def evaluate(self, frame: Frame) -> TrialStatus:
        period, down = self._ticks // self._ticks_of_a_period, frame.axes[self._axis] > 0.5
        self._ticks += 1
        if down:
            self._pressed.add(period)
        return TrialStatus(Phase.RUNNING, np.array([period, down], np.float64))

    def measure(self) -> Mapping[str, Value]:
        # The end of the trial may cut the last one off, before its press.
        whole = self._ticks // self._ticks_of_a_period
        pressed = sum(period < whole for period in self._pressed)
        return {"share": pressed / whole if whole else None}


@hookimpl
def labcrane_secondary() -> list[Offer[SecondaryTask]]:
    return [offer("my_part", MyPartSettings, MyPart)]
