"""Plan of one participant's session, before anything is opened."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from labcrane.core.records import PlannedTrial, Trial, Value
from labcrane.core.roles import Task
from labcrane.design.order import RULES, SQUARES, Turn, faded
from labcrane.design.seeds import derive
from labcrane.design.slots import group_of, place_of
from labcrane.design.tracks import PlannedTrack, plan_rounds, standing
from labcrane.protocol.design import AS_WRITTEN, CONDITION, Criterion, Switch
from labcrane.protocol.protocol import ASSIST
from labcrane.protocol.steps import READING_S, Block, Step
from labcrane.protocol.study import Study


@dataclass(frozen=True, slots=True)
class OwedQuestionnaire:
    """A questionnaire after a trial that a stopped session did not complete.

    Attributes
    ----------
    after
        The completed trial.
    answered
        Earlier answers.
    """

    after: Trial
    questionnaire: str
    answered: Mapping[str, Value]


@dataclass(frozen=True, slots=True)
class PlannedBlock:
    """A run of trials under one condition.

    Attributes
    ----------
    name
        The protocol's name for it.
    number
        Number of the block in the session, from 1, practice included.
    task
        The protocol's name of the task.
    practice
        Whether its trials are practice.
    levels
        The levels of each factor, in order; without a factor that a track chooses.
    trials
        First attempts, in order; with a track the maximum number, all at its first level.
    group
        The participant's between-subject group; "" when the study has none.
    until, last
        Criterion that ends practice, and whether this is the last planned round.
    reference
        Whether its trials give the operator's own reference time.
    ask
        Questionnaires after each counted trial.
    feedback
        Active feedback of each trial, by the trial's number; empty in a study without feedback.
    owed
        Remaining questionnaires of a stopped session, after completed trials.
    streak
        Number of counted successes in a row before it stopped.
    track
        The track that chooses the levels of a factor while it runs.
    unjudged
        The number of the test that the experimenter had still to judge when it stopped; 0 for none.
    condition
        Name of the participant's condition; "" for none.
    """

    name: str
    number: int
    task: str
    practice: bool
    levels: Mapping[str, tuple[str, ...]]
    trials: tuple[Trial, ...]
    group: str = ""
    until: Criterion | None = None
    last: bool = True
    reference: bool = False
    ask: tuple[str, ...] = ()
    feedback: Mapping[int, tuple[str, ...]] = field(default_factory=dict)
    owed: tuple[OwedQuestionnaire, ...] = ()
    streak: int = 0
    track: PlannedTrack | None = None
    unjudged: int = 0
    condition: str = ""

    @property
    def expected_s(self) -> float:
        """Expected duration in seconds; with a track, the maximum."""
        if self.track is not None:
            return self.track.longest_s * len(self.trials) / self.track.size
        return sum(trial.planned.expected_s for trial in self.trials)


@dataclass(frozen=True, slots=True)
class PlannedStep:
    """One step of a session: a text, a break, questionnaires or a block, counted from 1.

    Attributes
    ----------
    seconds
        Duration of a break, or of each point of a check of the eye tracker, in seconds.
    points
        The fixation points, as shares of the picture's width and height.
    answered
        Answers to its questionnaires before the session stopped.
    """

    number: int
    kind: str
    text: str = ""
    seconds: float = 0.0
    block: PlannedBlock | None = None
    questionnaires: tuple[str, ...] = ()
    answered: Mapping[str, Mapping[str, Value]] = field(default_factory=dict)
    points: tuple[tuple[float, float], ...] = ()

    @property
    def title(self) -> str:
        """Its name: that of its block or questionnaires, or its kind."""
        return self.block.name if self.block else ", ".join(self.questionnaires) or self.kind

    @property
    def expected_s(self) -> float:
        """Expected duration in seconds."""
        if self.block:
            return self.block.expected_s
        if self.kind == "fixation":
            return self.seconds * len(self.points)
        return self.seconds if self.kind == "break" else READING_S


@dataclass(frozen=True, slots=True)
class SessionPlan:
    """All steps of one session of one participant, in order.

    Attributes
    ----------
    seed
        The participant's seed.
    slot
        The participant's place in the design, counted from 1.
    group
        Between-subject group; "" when the study has none.
    held
        Who or what holds the session since before it stopped.
    """

    participant: str
    number: int
    name: str
    seed: int
    steps: tuple[PlannedStep, ...]
    slot: int = 1
    group: str = ""
    held: frozenset[str] = frozenset()

    @property
    def blocks(self) -> tuple[PlannedBlock, ...]:
        """The blocks among the steps."""
        return tuple(step.block for step in self.steps if step.block)

    @property
    def trials(self) -> tuple[Trial, ...]:
        """The trials that a study is about: those that are counted.

        Practice and approach movements are not among them.
        """
        return tuple(
            trial
            for block in self.blocks
            if not block.practice
            for trial in block.trials
            if trial.planned.counted
        )

    @property
    def expected_s(self) -> float:
        """Expected duration of the session in seconds."""
        return sum(step.expected_s for step in self.steps)


class Planner:
    """Plans one session, and numbers its blocks and trials."""

    def __init__(self, study: Study, participant: str, session: int, slot: int) -> None:
        self._study = study
        groups = tuple(study.protocol.design.groups)
        self.group = group_of(study.protocol.study, groups, slot)
        self._place = place_of(groups, slot)
        self._words = (study.protocol.study, participant, session)
        self._conditions = conditions_of(study, participant, self.group, self._place)
        self._steps = 0
        self._blocks = 0
        self._trials = 0

    def steps(self, step: Step) -> Iterator[PlannedStep]:
        """Yield a step of the protocol, once for each repetition."""
        if step.block is None:
            yield self._step(step, None)
            return
        rounds = step.block.until.rounds if step.block.until else 1
        for _ in range(step.block.repeat):
            for number in range(1, rounds + 1):
                block = self._block(step.block, step.kind, last=number == rounds)
                yield self._step(step, block)

    def _step(self, step: Step, block: PlannedBlock | None) -> PlannedStep:
        self._steps += 1
        return PlannedStep(
            self._steps,
            step.kind,
            step.text,
            step.seconds,
            block,
            step.questionnaires,
            points=step.points,
        )

    def _block(self, block: Block, kind: str, *, last: bool) -> PlannedBlock:
        self._blocks += 1
        task = self._study.tasks[block.task]
        levels = {}
        adaptive = self._study.protocol.design.tracks.get(block.track)
        for factor, written in task.factors().items():
            if adaptive is not None and factor == adaptive.factor:
                continue
            order = self._study.protocol.design.order.get(factor, AS_WRITTEN)
            seed = derive(*self._words, "order", factor, self._blocks)
            turn = Turn(seed, self._place + self._shift(factor))
            ordered = RULES[order.rule](written, turn, order.times, order.in_a_row)
            levels[factor] = ordered[: block.limits.get(factor)]
        condition, switch = "", block.feedback
        if block.condition is not None:
            condition = self._conditions[block.condition - 1]
            switch = self._study.protocol.design.conditions[condition]
        track = self._track(block, task, levels, condition) if adaptive is not None else None
        planned = (
            _of_condition(condition, task.plan(levels)) if track is None else self._rounds(track)
        )
        trials = tuple(map(self._trial, planned))
        feedback = self._feedback(switch, block.fading, trials)
        trials = tuple(replace(each, active=feedback.get(each.number, ())) for each in trials)
        name = block.name or block.task
        return PlannedBlock(
            name,
            self._blocks,
            block.task,
            kind == "practice",
            levels,
            trials,
            self.group,
            until=block.until,
            last=last,
            reference=kind == "reference",
            ask=block.ask,
            feedback=feedback,
            track=track,
            condition=condition,
        )

    def _track(
        self, block: Block, task: Task, levels: Mapping[str, tuple[str, ...]], condition: str
    ) -> PlannedTrack:
        track = self._study.protocol.design.tracks[block.track]
        rounds = {}
        for level in track.levels:
            if track.factor == ASSIST:
                trials = [_with(ASSIST, level, each) for each in task.plan(levels)]
            else:
                trials = list(task.plan({**levels, track.factor: (level,)}))
            rounds[level] = plan_rounds(block.track, level, _of_condition(condition, trials))
        size = len(next(iter(rounds.values())))
        return PlannedTrack(block.track, track, self._trials + 1, size * track.rounds, rounds)

    def _rounds(self, track: PlannedTrack) -> list[PlannedTrial]:
        """Return the maximum number of rounds, at the track's first level."""
        first = standing(track.settings).level
        if first is None:
            raise AssertionError("a track does not end before it begins")
        return list(track.rounds[first]) * track.settings.rounds

    def _shift(self, factor: str) -> int:
        """Return the number of rows by which a further square is shifted, to cross two squares.

        Whenever all rows of the first square have been used, the others begin a row later.
        """
        orders = self._study.protocol.design.order
        squares = [
            name for name, order in orders.items() if order.rule in SQUARES and name != CONDITION
        ]
        if factor not in squares[1:]:
            return 0
        factors = {
            name: levels
            for task in self._study.tasks.values()
            for name, levels in task.factors().items()
        }
        rows = len(SQUARES[orders[squares[0]].rule](len(factors[squares[0]])))
        return squares.index(factor) * (self._place // rows)

    def _feedback(
        self, chosen: Switch, fading: Sequence[float], trials: Sequence[Trial]
    ) -> dict[int, tuple[str, ...]]:
        """Return each trial's active feedback; an uncounted one is like the next counted one."""
        protocol = self._study.protocol
        if not protocol.switched:
            return {}
        if chosen == "group":
            names = protocol.design.groups[self.group]
        elif chosen == "all":
            names = protocol.switched
        else:
            names = () if chosen == "none" else chosen
        on = iter(faded(sum(trial.planned.counted for trial in trials), fading))
        shown: dict[int, tuple[str, ...]] = {}
        waiting: list[int] = []
        for trial in trials:
            waiting.append(trial.number)
            if trial.planned.counted:
                now = names if next(on) else ()
                shown.update(dict.fromkeys(waiting, now))
                waiting.clear()
        return shown | dict.fromkeys(waiting, names)

    def _trial(self, planned: PlannedTrial) -> Trial:
        self._trials += 1
        return Trial(self._trials, 1, derive(*self._words, "trial", self._trials, 1), planned)


def _of_condition(condition: str, trials: Sequence[PlannedTrial]) -> Sequence[PlannedTrial]:
    """Return trials with their condition within participants; unchanged without one."""
    if not condition:
        return trials
    return [_with(CONDITION, condition, each) for each in trials]


def _with(column: str, level: str, trial: PlannedTrial) -> PlannedTrial:
    """Return a trial with one more variable of its condition."""
    return replace(trial, condition={**trial.condition, column: level})


def conditions_of(study: Study, participant: str, group: str, place: int) -> tuple[str, ...]:
    """Return a participant's conditions in order; it is the same in all sessions.

    Of each group as many participants as a square has rows get every row once, in a random
    order: the last participant's row does not reveal the next one's.
    """
    design, name = study.protocol.design, study.protocol.study
    order, levels = design.order.get(CONDITION, AS_WRITTEN), tuple(design.conditions)
    if not levels:
        return ()
    if order.rule in SQUARES:
        rows = len(SQUARES[order.rule](len(levels)))
        run, at = divmod(place, rows)
        drawn = np.random.default_rng(derive(name, CONDITION, group, run)).permutation(rows)
        place = int(drawn[at])
    turn = Turn(derive(name, participant, CONDITION), place)
    return RULES[order.rule](levels, turn, order.times, order.in_a_row)


def slot_by_name(participant: str) -> int:
    """Return the slot that follows from a pseudonym's number: 7 for ``P007``.

    For plans, pilots and simulations, which have no slot in the register.
    """
    digits = re.search(r"\d+$", participant)
    return max(1, int(digits[0])) if digits else 1


def plan_session(
    study: Study, participant: str, session: int, slot: int | None = None
) -> SessionPlan:
    """Return the plan of ``session`` (from 1) of ``participant``.

    ``slot`` is the participant's in the register; without it, the one of the pseudonym's number.
    """
    study.check_participant(participant)
    study.check_session(session)
    slot = slot or slot_by_name(participant)
    written = study.protocol.sessions[session - 1]
    planner = Planner(study, participant, session, slot)
    steps = tuple(planned for step in written.steps for planned in planner.steps(step))
    seed = derive(study.protocol.study, participant)
    return SessionPlan(participant, session, written.name, seed, steps, slot, planner.group)


def next_attempt(
    study: Study, plan: SessionPlan, trial: Trial, attempt: int, start: Sequence[float] = ()
) -> Trial:
    """Return ``trial`` once more, as a given attempt with a seed of its own.

    It begins with the joint angles ``start`` in rad, unless it is planned to begin with others or
    none are given. Otherwise the path would begin where the last attempt was cut off.
    """
    words = (study.protocol.study, plan.participant, plan.number, "trial", trial.number, attempt)
    pose = tuple(start) or None
    return replace(trial, attempt=attempt, seed=derive(*words), start_pose=pose)
