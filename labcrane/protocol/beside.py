"""A task with secondary tasks beside it, which is one task to the loop, the plan and the record."""

from collections.abc import Container, Mapping, Sequence
from dataclasses import replace

import numpy as np

from labcrane.core.primitives import Sphere
from labcrane.core.records import Event, Frame, PlannedTrial, Run, Trial, TrialStatus, Value
from labcrane.core.roles import SecondaryTask, Task
from labcrane.core.signals import Layout
from labcrane.types import FloatArray


class Beside(Task):
    """A task, and what runs beside it: their signals and results are one row.

    It has no compiled kernel. The task alone decides when a trial ends.

    Parameters
    ----------
    task
        The task.
    secondary
        What runs beside it, by the protocol's names.
    always
        Names of those that are on in every trial.
    """

    def __init__(
        self, task: Task, secondary: Mapping[str, SecondaryTask], always: Container[str] = ()
    ) -> None:
        self._task, self._secondary, self._always = task, secondary, always
        self.signals = (
            *task.signals,
            *(
                replace(signal, name=f"{name}.{signal.name}")
                for name, each in secondary.items()
                for signal in each.signals
            ),
        )
        self.results = (
            *task.results,
            *(
                replace(signal, name=f"{name}_{signal.name}")
                for name, each in secondary.items()
                for signal in each.results
            ),
        )
        self.conditions, self.reports = task.conditions, task.reports
        self._rest = {
            name: np.full(Layout(name, each.signals).size, np.nan)
            for name, each in secondary.items()
        }
        self._active: Mapping[str, SecondaryTask] = {}

    def open(self, run: Run) -> None:
        for each in (self._task, *self._secondary.values()):
            each.open(run)

    def close(self) -> None:
        for each in (self._task, *self._secondary.values()):
            each.close()

    def metadata(self) -> Mapping[str, Value]:
        return self._task.metadata()

    def begin_trial(self, trial: Trial) -> None:
        self._task.begin_trial(trial)
        self._active = {
            name: each
            for name, each in self._secondary.items()
            if name in trial.active or name in self._always
        }
        for each in self._active.values():
            each.begin_trial(trial)

    def factors(self) -> Mapping[str, Sequence[str]]:
        return self._task.factors()

    def plan(self, levels: Mapping[str, Sequence[str]]) -> Sequence[PlannedTrial]:
        return self._task.plan(levels)

    def places(self) -> Sequence[Sphere]:
        return self._task.places()

    def lift_limits(self) -> None:
        self._task.lift_limits()

    def evaluate(self, frame: Frame) -> TrialStatus:
        status = self._task.evaluate(frame)
        values: list[FloatArray] = [status.values]
        events, results = status.events, dict(status.results)
        for name, resting in self._rest.items():
            if name not in self._active:
                values.append(resting)
                continue
            beside = self._active[name].evaluate(frame)
            values.append(beside.values)
            events += tuple(
                Event(each.name, each.time, {"secondary": name, **each.data})
                for each in beside.events
            )
        if status.phase.over:
            for name, each in self._active.items():
                results |= {f"{name}_{key}": value for key, value in each.measure().items()}
        return TrialStatus(status.phase, np.concatenate(values), events, results)
