"""A study whose trials are counted ticks, so that hundreds of sessions of it run in a second."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from rehearsal import a_study

from labcrane import Controller, Dynamics, InputDevice, Questionnaire, Signal, Task
from labcrane.core import Item, Phase, PlannedTrial, Score, TrialStatus
from labcrane.protocol.design import Criterion
from labcrane.protocol.evaluation import StopRule
from labcrane.protocol.protocol import OnFault
from labcrane.protocol.rig import Rig
from labcrane.protocol.steps import Block, Session, Step
from labcrane.testing import Study

OUTCOMES = (Phase.SUCCESS, Phase.SUCCESS, Phase.FAILURE, Phase.TIMEOUT)


class Idle(InputDevice):
    signals = (Signal("left.x", "1"),)

    def read(self, tick, seen):
        return np.zeros(1)


class Nothing(Controller):
    signals = (Signal("command", "1"),)

    def command(self, axes, state):
        return np.zeros(1)

    def inverse(self, velocity, state):
        return np.zeros(1)


class Still(Dynamics):
    def __init__(self, joints: Sequence[str]) -> None:
        self.signals = tuple(Signal(f"joint.angle.{joint}", "rad") for joint in joints)
        self._angles = np.zeros(len(joints))

    def state(self):
        return self._angles

    def step(self, command, dt):
        return self._angles

    def reset(self, pose):
        self._angles = np.array(pose)

    def bodies(self):
        return []


class Count(Task):
    """Trials of one to four ticks that end as their seed says; every third one is uncounted."""

    signals = (Signal("left", "1"),)

    def factors(self) -> Mapping[str, Sequence[str]]:
        return {"item": tuple("abcd")}

    def plan(self, levels):
        return [
            PlannedTrial({"item": item}, expected_s=1.0, counted=number % 3 != 0)
            for number, item in enumerate(levels["item"])
        ]

    def begin_trial(self, trial) -> None:
        self._left = 1 + trial.seed % 4
        self._outcome = OUTCOMES[trial.seed // 7 % len(OUTCOMES)]

    def evaluate(self, frame):
        self._left -= 1
        phase = Phase.RUNNING if self._left > 0 else self._outcome
        return TrialStatus(phase, np.array([float(self._left)]))

    def lift_limits(self) -> None:
        pass


class Rating(Questionnaire):
    title, rights = "Rating", "our own"
    scores = (Score("sum", 0.0, 20.0),)

    def items(self):
        return [Item("one", "One?"), Item("two", "Two?")]

    def score(self, answers):
        return {"sum": float(answers.get("one") or 0.0) + float(answers.get("two") or 0.0)}


def stoppable(folder: Path) -> Study:
    """Return a study whose sessions are to be filled in by :func:`with_steps`."""
    study = a_study(folder)
    oncer = {"rating": Rating(), "other": Rating()}
    return replace(
        study,
        tasks={"count": Count()},
        questionnaires=oncer,
        protocol=study.protocol.model_copy(
            update={
                "rate_hz": 10,
                "stop_rules": (StopRule(questionnaire="rating", score="sum", above=15.0),),
                "on_fault": OnFault(input_lost="end"),
            }
        ),
    )


def with_steps(study: Study, steps: Sequence[Step]) -> Study:
    session = Session(name="only", steps=tuple(steps))
    return replace(study, protocol=study.protocol.model_copy(update={"sessions": (session,)}))


def block(kind: str, items: int, ask: Sequence[str], until: tuple[int, int] | None) -> Step:
    criterion = Criterion(successes=until[0], rounds=until[1]) if until else None
    return Step(kind=kind, block=Block(task="count", item=items, ask=tuple(ask), until=criterion))


def idle_rig(study: Study) -> Rig:
    return Rig(Idle(), Nothing(), Still(study.machine.names), study.tasks)
