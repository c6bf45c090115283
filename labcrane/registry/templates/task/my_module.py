"""my_part: what the operator is asked to do."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from pydantic import PositiveFloat

from labcrane import Frame, Offer, Run, Settings, Signal, Task, Trial, hookimpl, offer
from labcrane.core import Event, Phase, PlannedTrial, TrialStatus

labcrane_api = 1


class MyPartSettings(Settings):
    """Settings of my_part; a protocol writes them next to ``use``."""

    heights: tuple[float, ...] = (0.5, 1.5)
    """Heights of the targets above the base, in metres; each is one trial."""

    radius: PositiveFloat = 0.3
    """Of a target, in metres."""

    limit_s: PositiveFloat = 30.0
    """Time after which a trial ends without success, in seconds."""


class MyPart(Task):
    """Touch a target 5 m ahead, at one height after the other."""

    # What is shown every tick: views, sounds and simulated operators look for these two.
    signals = (Signal("target.position", "m", ("x", "y", "z")), Signal("target.radius", "m"))
    # What a finished trial is measured by.
    results = (Signal("duration", "s", definition="from the start of the trial to its end"),)
    # What is varied in trials.
    conditions = (Signal("height", "m", definition="height of the target above the ground"),)

    def __init__(self, settings: MyPartSettings) -> None:
        self._settings = settings

    def factors(self) -> Mapping[str, Sequence[str]]:
        """Return the factors that a protocol may order: design: {order: {heights: shuffled}}."""
        return {"heights": [f"{height:g}" for height in self._settings.heights]}

    def plan(self, levels: Mapping[str, Sequence[str]]) -> Sequence[PlannedTrial]:
        return [
            PlannedTrial({"height": float(level)}, expected_s=8.0) for level in levels["heights"]
        ]

    def open(self, run: Run) -> None:
        self._tip = run.state.find("tip.position")

    def begin_trial(self, trial: Trial) -> None:
        self._target = np.array([5.0, 0.0, float(str(trial.planned.condition["height"]))])
        self._limit_s = self._settings.limit_s

    def lift_limits(self) -> None:
        self._limit_s = math.inf

    def evaluate(self, frame: Frame) -> TrialStatus:
        values = np.array([*self._target, self._settings.radius])
        distance = float(np.linalg.norm(frame.state[self._tip] - self._target))
        if distance <= self._settings.radius:
            touched = Event("target.touched", frame.tick.due, {"distance": distance})
            return TrialStatus(Phase.SUCCESS, values, (touched,), {"duration": frame.elapsed})
        if frame.elapsed >= self._limit_s:
            return TrialStatus(Phase.TIMEOUT, values, (), {"duration": frame.elapsed})
        return TrialStatus(Phase.RUNNING, values)


@hookimpl
def labcrane_tasks() -> list[Offer[Task]]:
    return [offer("my_part", MyPartSettings, MyPart)]
