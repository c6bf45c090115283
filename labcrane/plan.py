"""What a session of one participant consists of, before anything is opened."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from labcrane.design.order import RULES
from labcrane.design.seeds import derive
from labcrane.protocol import Block, Step
from labcrane.records import Planned, Trial
from labcrane.study import Study

# Seconds an examiner and a participant are likely to spend on a page of text, for plans only.
READING_S = 120.0


@dataclass(frozen=True, slots=True)
class PlannedBlock:
    """A run of trials under one condition.

    Attributes
    ----------
    name
        The protocol's name for it.
    number
        Counts the session's blocks from 1, practice included.
    task
        The protocol's name of the task.
    practice
        Whether its trials are practice.
    levels
        The levels of each factor, in the order in which they come.
    trials
        First attempts, in order.
    """

    name: str
    number: int
    task: str
    practice: bool
    levels: Mapping[str, tuple[str, ...]]
    trials: tuple[Trial, ...]

    @property
    def expected_s(self) -> float:
        """How long it is likely to take, in seconds."""
        return sum(trial.planned.expected_s for trial in self.trials)


@dataclass(frozen=True, slots=True)
class PlannedStep:
    """One step of a session: a text, a break, or a block. Steps are counted from 1."""

    number: int
    kind: str
    text: str = ""
    seconds: float = 0.0
    block: PlannedBlock | None = None

    @property
    def expected_s(self) -> float:
        """How long it is likely to take, in seconds."""
        if self.block:
            return self.block.expected_s
        return self.seconds if self.kind == "break" else READING_S


@dataclass(frozen=True, slots=True)
class SessionPlan:
    """All steps of one session of one participant, in order."""

    participant: str
    number: int
    name: str
    seed: int
    steps: tuple[PlannedStep, ...]

    @property
    def blocks(self) -> tuple[PlannedBlock, ...]:
        """The blocks among the steps."""
        return tuple(step.block for step in self.steps if step.block)

    @property
    def expected_s(self) -> float:
        """How long the session is likely to take, in seconds."""
        return sum(step.expected_s for step in self.steps)


class Planner:
    """Plans one session; counts its blocks and trials on the way."""

    def __init__(self, study: Study, participant: str, session: int) -> None:
        self._study = study
        self._words = (study.protocol.study, participant, session)
        self._steps = 0
        self._blocks = 0
        self._trials = 0

    def steps(self, step: Step) -> Iterator[PlannedStep]:
        """Yield a step of the protocol, once for each repetition."""
        for _ in range(step.block.repeat if step.block else 1):
            self._steps += 1
            block = self._block(step.block, step.kind == "practice") if step.block else None
            yield PlannedStep(self._steps, step.kind, step.text, step.seconds, block)

    def _block(self, block: Block, practice: bool) -> PlannedBlock:  # noqa: FBT001 - one caller
        self._blocks += 1
        task = self._study.tasks[block.task]
        levels = {}
        for factor, written in task.factors().items():
            rule = RULES[self._study.protocol.design.order.get(factor, "as_written")]
            seed = derive(*self._words, "order", factor, self._blocks)
            levels[factor] = rule(written, seed)[: block.limits.get(factor)]
        trials = tuple(self._trial(planned) for planned in task.plan(levels))
        name = block.name or block.task
        return PlannedBlock(name, self._blocks, block.task, practice, levels, trials)

    def _trial(self, planned: Planned) -> Trial:
        self._trials += 1
        return Trial(self._trials, 1, derive(*self._words, "trial", self._trials, 1), planned)


def plan_session(study: Study, participant: str, session: int) -> SessionPlan:
    """Return what happens in ``session`` (from 1) of ``participant``."""
    study.check_participant(participant)
    study.check_session(session)
    written = study.protocol.sessions[session - 1]
    planner = Planner(study, participant, session)
    steps = tuple(planned for step in written.steps for planned in planner.steps(step))
    seed = derive(study.protocol.study, participant)
    return SessionPlan(participant, session, written.name, seed, steps)


def next_attempt(
    study: Study, plan: SessionPlan, trial: Trial, attempt: int | None = None
) -> Trial:
    """Return ``trial`` once more, as its next attempt or a given one, with a seed of its own."""
    attempt = attempt or trial.attempt + 1
    words = (study.protocol.study, plan.participant, plan.number, "trial", trial.number, attempt)
    return Trial(trial.number, attempt, derive(*words), trial.planned)
