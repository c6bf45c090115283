"""Progress of a session and what remains of it, to continue after any stop.

Nothing is written for this alone. The remaining trials are derived from the plan and the events in
the journal, by the same fold while the session runs and afterwards; so a session that was killed
reads like one that was ended by an action.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from labcrane.analysis.scoring.settings import COUNTS, TIME
from labcrane.core.records import UNDONE, Phase, Trial, Value, is_counted
from labcrane.design.counts import TableNumbers, TrialCounts, numbers, spans
from labcrane.design.plan import (
    OwedQuestionnaire,
    PlannedBlock,
    PlannedStep,
    SessionPlan,
    next_attempt,
)
from labcrane.design.practice import WarmUp
from labcrane.design.tracks import LEVEL, PlannedTrack, Response, TrackState, check_carried
from labcrane.errors import ProtocolError, RecordingError
from labcrane.protocol.study import Study
from labcrane.recording.journal_reader import SessionLog, read_journal
from labcrane.recording.paths import parts
from labcrane.session.standing import EXAMINER, STOP
from labcrane.types import FloatArray

Policy = Literal["continue", "redo_trial", "redo_block"]

BROKEN = frozenset({Phase.ENDED, Phase.INTERRUPTED})
"""How an attempt ends that the session stopped in the middle of."""

COMPLETE, INCOMPLETE = "complete", "incomplete"
"""Why a session ended by itself: nothing remains, or only trials that the policy abandoned."""

RECORD = TableNumbers()

KILLED = "its process died"
"""How a session stopped whose journal has no end."""


@dataclass
class Progress:
    """How far a session came, from its events.

    Attributes
    ----------
    stop
        Why it last stopped, in words; :data:`KILLED` when it has not said so.
    called_complete
        Whether it has called itself complete.
    steps
        Numbers of the steps that ran to their end.
    attempts
        The last attempt of every trial that was begun, by trial number.
    done
        How every trial ended that needs no further attempt, by trial number.
    broken
        Numbers of the trials whose last attempt was cut off.
    begun
        What was said at the start of every trial, by trial number.
    interrupted
        Data of the trial that was under way when the process died; None between trials.
    angles
        Last joint angles in rad, shape ``(n_joints,)``; empty when there is no frame.
    starts
        Joint angles in rad at the start of the first attempt at every trial that was begun.
    time
        When the last frame was due, in seconds; None without one.
    answers
        What was answered, by step and questionnaire.
    handed_in
        Steps and questionnaires that need not be asked again.
    rated, ratings
        The same of what is asked after trials, by trial and questionnaire.
    held
        Who held it: the experimenter, a stop rule.
    responses
        What every trial told its track, by trial number, in the order in which they ended.
    carried
        What trials of earlier sessions told their tracks.
    judged
        Whether the session waits for the experimenter to judge its tests.
    unjudged
        Data at the end of the last test, if the experimenter can still judge it; None
        otherwise.
    """

    stop: str = KILLED
    called_complete: bool = False
    steps: set[int] = field(default_factory=set)
    attempts: dict[int, int] = field(default_factory=dict)
    done: dict[int, Phase] = field(default_factory=dict)
    broken: set[int] = field(default_factory=set)
    begun: dict[int, Mapping[str, Any]] = field(default_factory=dict)
    interrupted: Mapping[str, Any] | None = None
    angles: tuple[float, ...] = ()
    starts: dict[int, tuple[float, ...]] = field(default_factory=dict)
    time: float | None = None
    answers: dict[tuple[int, str], dict[str, Value]] = field(default_factory=dict)
    handed_in: set[tuple[int, str]] = field(default_factory=set)
    ratings: dict[tuple[int, str], dict[str, Value]] = field(default_factory=dict)
    rated: set[tuple[int, str]] = field(default_factory=set)
    held: set[str] = field(default_factory=set)
    responses: dict[int, Response] = field(default_factory=dict)
    carried: tuple[Response, ...] = ()
    judged: bool = False
    unjudged: Mapping[str, Any] | None = None

    def take(self, name: str, data: Mapping[str, Any]) -> None:
        """Take up an event."""
        match name:
            case "session.start":
                self.stop, self.called_complete = KILLED, False
                self.carried, self.judged = carried_in(data), judged_in(data)
            case "session.end":
                self.stop = str(data["reason"])
                self.called_complete = self.stop == COMPLETE
            case "session.failed":
                self.stop = str(data["why"])
            case "session.resumed":
                self._take_void(numbers(data["void"]))
            case "order.completion" | "order.override" | "judgement.over":
                self._take_judgement(name, data)
            case "step.end" if data["done"]:
                self.steps.add(data["step"])
            case "trial.start" | "trial.end":
                self._take_trial(name, data)
            case "questionnaire.answer" | "questionnaire.end":
                self._take_questionnaire(name, data)
            case "pause.start" | "pause.end" | "stop_rule.met":
                self._take_hold(name, data)

    def _take_void(self, again: Iterable[int]) -> None:
        for number in again:
            self.done.pop(number, None)
            self.responses.pop(number, None)
            if self.unjudged is not None and self.unjudged["trial"] == number:
                self.unjudged = None

    def _take_trial(self, name: str, data: Mapping[str, Any]) -> None:
        number = data["trial"]
        if name == "trial.start":
            self.attempts[number] = data["attempt"]
            self.begun[number] = self.interrupted = data
            self.done.pop(number, None)  # of two attempts the later one counts
            self.responses.pop(number, None)
            self.broken.discard(number)
            self.unjudged = None
            for asked in [key for key in self.rated | set(self.ratings) if key[0] == number]:
                self.rated.discard(asked)
                self.ratings.pop(asked, None)
            return
        self.interrupted = None
        outcome = Phase(data["outcome"])
        if outcome in BROKEN:
            self.broken.add(number)
        elif outcome is not Phase.REPEATED:
            self.done[number] = outcome
            if self.judged and is_open(data):
                self.unjudged = data
            if (response := Response.of(data)) is not None:
                self.responses[number] = response

    def _take_questionnaire(self, name: str, data: Mapping[str, Any]) -> None:
        rating = "trial" in data
        key = (data["trial"] if rating else data["step"], data["questionnaire"])
        if name == "questionnaire.answer":
            given = (self.ratings if rating else self.answers).setdefault(key, {})
            given[data["item"]] = data["value"]
        elif data["done"]:
            (self.rated if rating else self.handed_in).add(key)

    def _take_judgement(self, name: str, data: Mapping[str, Any]) -> None:
        """Note that the last test was judged after its end, or that it stays as it is."""
        said = data.get("after") and data.get("refused") is None
        if data.get("done") if name == "judgement.over" else said:
            self.unjudged = None

    def _take_hold(self, name: str, data: Mapping[str, Any]) -> None:
        if name == "pause.end":
            self.held.discard(data["by"])
        elif name == "stop_rule.met":
            self.held.add(STOP)
        elif data["by"] in {EXAMINER, STOP}:
            self.held.add(data["by"])


def carried_in(context: Mapping[str, Any]) -> tuple[Response, ...]:
    """Return what a session's context says that its tracks go on from."""
    return tuple(Response(**each) for each in context.get("carried", ()))


def judged_in(context: Mapping[str, Any]) -> bool:
    """Return whether a session waits for its tests to be judged, by its context."""
    return bool(context.get("awaits_judgement"))


def is_open(ended: Mapping[str, Value]) -> bool:
    """Whether a trial is a test without a completion factor, by its ``trial.end``.

    A test counts for the performance indicator: it has the columns from which that is worked out,
    and is neither practice nor reference.
    """
    test = is_counted(ended) and not ended.get("reference") and ended["outcome"] not in UNDONE
    there = {TIME, *COUNTS.values()} <= ended.keys()
    return test and there and ended.get("completion") is None


def carry(study: Study, journals: Sequence[Path]) -> tuple[Response, ...]:
    """Return what earlier sessions told the tracks that go on from session to session.

    Parameters
    ----------
    journals
        The first parts of those sessions' journals, in their order; one that was not held has none.

    Raises
    ------
    ProtocolError
        A track has lost a level since.
    """
    tracks = {name: each for name, each in study.protocol.design.tracks.items() if each.carry}
    if not tracks:
        return ()
    told = [
        each
        for journal in journals
        if parts(journal)
        for each in progress(journal, study.machine.names).responses.values()
        if each.track in tracks and each.success is not None
    ]
    check_carried(tracks, told)
    return tuple(told)


def progress(journal: Path, joints: Sequence[str]) -> Progress:
    """Return how far the session with this journal, all its parts included, has come.

    Raises
    ------
    ProtocolError
        There is no such journal, so there is nothing to continue.
    RecordingError
        An event in it does not say what such an event says: labcrane has not written it.
    """
    found = parts(journal)
    if not found:
        raise ProtocolError(
            f"there is no journal {journal}, and so no session to continue; start one with "
            "labcrane run"
        )
    log, _ = read_journal(found)
    time = float(log.time[-1]) if len(log.time) else None
    angles = _angles(log, joints)
    so_far = Progress(angles=tuple(angles[-1].tolist()) if len(angles) else (), time=time)
    for event in log.events:
        try:
            so_far.take(event.name, event.data)
        except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError) as error:
            raise RecordingError(
                f"{journal}: event {event.name!r} at {event.time:.3f} s lacks a value "
                f"that it needs ({error!r}), so the remaining trials are unknown; "
                f"use labcrane recover {journal.parent} to save the recorded data"
            ) from error
        if event.name == "trial.start" and event.data["trial"] not in so_far.starts:
            at = int(np.searchsorted(log.time, event.time))
            if at < len(angles) and np.isfinite(angles[at]).all():
                so_far.starts[event.data["trial"]] = tuple(angles[at].tolist())
    return so_far


def _angles(log: SessionLog, joints: Sequence[str]) -> FloatArray:
    """Return the joint angles of every frame in rad, shape ``(n_frames, n_joints)``.

    It is empty when a joint was not recorded.
    """
    columns = {(column.group, column.label): at for at, column in enumerate(log.columns)}
    wanted = [columns.get(("state", f"joint.angle.{joint}")) for joint in joints]
    found = [at for at in wanted if at is not None]
    if len(found) < len(wanted):
        return np.empty((0, len(joints)))
    return np.vstack([np.empty((0, len(joints))), *(block[:, found] for block in log.blocks())])


def check_recorded(plan: SessionPlan, so_far: Progress) -> None:
    """Make sure that what was recorded is of this plan.

    Raises
    ------
    ProtocolError
        A trial was recorded that the plan does not have, or has otherwise.
    """
    planned = {trial.number: (block, trial) for block in plan.blocks for trial in block.trials}
    for number, said in sorted(so_far.begun.items()):
        about = _about(*planned[number], said) if number in planned else {}
        wrong = [name for name, value in about.items() if said.get(name) != value]
        if wrong or not about:
            was = ", ".join(f"{name} {said.get(name)!r}" for name in wrong) or "recorded"
            has = ", ".join(f"{name} {about[name]!r}" for name in wrong) or "no such trial"
            raise ProtocolError(
                f"the session was begun with another plan: trial {number} was {was}, and the plan "
                f"has {has}; continue with the protocol, and the place in the design, with which "
                "it was begun"
            )


def _about(block: PlannedBlock, trial: Trial, said: Mapping[str, Any]) -> dict[str, Value]:
    """Return what is said at a trial's start, at the level that its track chose if it has one."""
    level = str(said.get(LEVEL))
    chosen = block.track.at(trial.number, level) if block.track is not None else None
    planned = chosen or trial.planned
    return {
        "block": block.number,
        "block_name": block.name,
        "practice": block.practice,
        "counted": planned.counted,
        **planned.condition,
    }


class Ledger:
    """Keeps account of what remains of a session, event by event.

    Parameters
    ----------
    whole
        The whole session's plan, whatever was done of it before.
    so_far
        What was done of it before this process; None when nothing was.
    """

    def __init__(self, study: Study, whole: SessionPlan, so_far: Progress | None = None) -> None:
        self._study = study
        self._whole = whole
        self._so_far = so_far or Progress()
        self.take = self._so_far.take

    def owed(self) -> SessionPlan:
        """Return what remains, including abandoned trials."""
        return remaining(self._study, self._whole, self._so_far, "redo_trial")

    def chosen(self, block: PlannedBlock, trial: Trial) -> Trial | None:
        """Return a trial as the block's track wants it now; None when it has come to its end."""
        if block.track is None:
            return trial
        return block.track.choose(trial, self._so_far.responses, self._so_far.carried)

    def stands(self, track: PlannedTrack) -> TrackState:
        """Return where a track stands."""
        return track.stands(self._so_far.responses, self._so_far.carried)

    @property
    def unjudged(self) -> dict[str, Value]:
        """Trial and attempt of the test that waits for the experimenter's judgement, if any."""
        ended = self._so_far.unjudged
        return {} if ended is None else {name: ended[name] for name in ("trial", "attempt")}


def remaining(study: Study, plan: SessionPlan, so_far: Progress, policy: Policy) -> SessionPlan:
    """Return what is left of a plan.

    A trial is done when its last attempt came to an end of its own or was skipped; whatever else a
    step consists of is done when it says so itself. Of a block with trials left all are redone
    when the policy is to redo the block; a trial that was cut off is redone unless the policy is to
    continue with the next one. What is run again is a new attempt.
    """
    steps = []
    for step in plan.steps:
        if step.block:
            block = _rest(study, plan, step.block, so_far, policy)
            if block.trials or block.owed or block.unjudged:
                steps.append(replace(step, block=block))
        elif step.questionnaires:
            unasked = _unasked(step, so_far)
            if unasked.questionnaires:
                steps.append(unasked)
        elif step.number not in so_far.steps:
            steps.append(step)
    ended = tuple(_ended_practices(plan, steps))
    return replace(plan, steps=ended, held=frozenset(so_far.held))


def _ended_practices(plan: SessionPlan, steps: Sequence[PlannedStep]) -> Iterator[PlannedStep]:
    """Yield steps that are left, where the last round that is left of a practice ends it.

    The rounds after it are no longer needed; without this the next practice would continue it.
    """
    practice: dict[int, int] = {}
    number = 0
    for step in plan.steps:
        if step.block:
            practice[step.number] = number
            number += step.block.until is None or step.block.last
    last = {practice[step.number]: step.number for step in steps if step.block}
    for step in steps:
        ends = step.block and step.block.until and last[practice[step.number]] == step.number
        yield replace(step, block=replace(step.block, last=True)) if step.block and ends else step


def _unasked(step: PlannedStep, so_far: Progress) -> PlannedStep:
    """Return a step with the questionnaires that are left, and what was answered of them."""
    left = [name for name in step.questionnaires if (step.number, name) not in so_far.handed_in]
    answered = {name: so_far.answers.get((step.number, name), {}) for name in left}
    return replace(step, questionnaires=tuple(left), answered=answered)


def _rest(
    study: Study,
    plan: SessionPlan,
    block: PlannedBlock,
    so_far: Progress,
    policy: Policy,
) -> PlannedBlock:
    warm_up = _warm_up(plan, block, so_far)
    left: list[Trial] = []
    if not warm_up.over:
        left = [trial for trial in block.trials if trial.number not in so_far.done]
    if left and block.track is not None:
        chosen = block.track.choose(left[0], so_far.responses, so_far.carried)
        left = left if chosen is not None else []
    begun = [trial.number for trial in block.trials if trial.number in so_far.attempts]
    if policy == "redo_block" and left and begun:
        attempt = 1 + max(so_far.attempts[number] for number in begun)
        first = _once_more(study, plan, block.trials[0], so_far, attempt)
        again = [first, *(next_attempt(study, plan, each, attempt) for each in block.trials[1:])]
        before = _warm_up(plan, block, so_far, but=block)
        return replace(block, trials=tuple(again), streak=before.streak)
    if policy == "continue":
        cut_off = so_far.broken | ({so_far.interrupted["trial"]} if so_far.interrupted else set())
        left = [trial for trial in left if trial.number not in cut_off]
    again = [
        _once_more(study, plan, trial, so_far, so_far.attempts[trial.number] + 1)
        if trial.number in so_far.attempts
        else trial
        for trial in left
    ]
    owed = tuple(_owed(block, so_far))
    unjudged = _unjudged(block, so_far, again)
    return replace(block, trials=tuple(again), owed=owed, streak=warm_up.streak, unjudged=unjudged)


def _once_more(
    study: Study, plan: SessionPlan, trial: Trial, so_far: Progress, attempt: int
) -> Trial:
    """Return another attempt at a trial, which begins where the first one began."""
    start = so_far.starts.get(trial.number, ())
    return next_attempt(study, plan, trial, attempt, within_limits(study, start) if start else ())


def _unjudged(block: PlannedBlock, so_far: Progress, left: Sequence[Trial]) -> int:
    """Return the number of the block's test that waits to be judged; 0 for none.

    Before another trial there is time for that only where nothing else is asked.
    """
    number = so_far.unjudged["trial"] if so_far.unjudged is not None else 0
    waits = not (left and block.ask) and number in {trial.number for trial in block.trials}
    return number if waits else 0


def _warm_up(
    plan: SessionPlan, block: PlannedBlock, so_far: Progress, but: PlannedBlock | None = None
) -> WarmUp:
    """Return how far the practice has come that a block is a round of, leaving one round out.

    Trials count in the order in which they were done, as they did when it ran: one that was passed
    over may have been done after those that follow it.
    """
    warm_up = WarmUp()
    if block.until is None:
        return warm_up
    counted = {
        trial.number
        for each in _rounds(plan, block)
        if each is not but
        for trial in each.trials
        if trial.planned.counted
    }
    for number, outcome in so_far.done.items():
        if number in counted:
            warm_up.count(block, outcome)
    return warm_up


def _rounds(plan: SessionPlan, block: PlannedBlock) -> list[PlannedBlock]:
    """Return all rounds of the practice that a block is one of."""
    rounds: list[PlannedBlock] = []
    for each in plan.blocks:
        rounds.append(each)
        if each.until is None or each.last:
            if block in rounds:
                return [one for one in rounds if one.until is not None]
            rounds = []
    return [block]


def _owed(block: PlannedBlock, so_far: Progress) -> Iterator[OwedQuestionnaire]:
    """Yield what is still to be asked after trials that are done."""
    for trial in block.trials:
        if trial.planned.counted and trial.number in so_far.done:
            for name in block.ask:
                if (trial.number, name) not in so_far.rated:
                    yield OwedQuestionnaire(
                        trial, name, so_far.ratings.get((trial.number, name), {})
                    )


def resumption(plan: SessionPlan, so_far: Progress, policy: Policy) -> dict[str, Value]:
    """Return the record of a resumption: how it stopped, what remains and what is repeated.

    ``void`` are the trials that were done and are redone with their block.
    """
    again = repeats(plan, so_far)
    return {
        "after": so_far.stop,
        "policy": policy,
        "owed": owed_text(plan),
        "repeats": spans(again),
        "void": spans([number for number in again if number in so_far.done]),
    }


def repeats(plan: SessionPlan, so_far: Progress) -> list[int]:
    """Return the numbers of the trials that are left in a plan and were begun before."""
    left = (trial.number for block in plan.blocks for trial in block.trials)
    return [number for number in left if number in so_far.attempts]


def owed_text(plan: SessionPlan, counts: TrialCounts | TableNumbers = RECORD) -> str:
    """Return what a plan consists of in words; empty for nothing.

    ``counts`` are the whole session's for people; the record has the numbers of its trial table.
    """
    return "; ".join(text for step in plan.steps for text in _step_texts(step, counts))


def _step_texts(step: PlannedStep, counts: TrialCounts | TableNumbers) -> Iterator[str]:
    block = step.block
    if block is None:
        asked = " ".join(step.questionnaires)
        yield f"step {step.number}: {step.kind}" + (f" {asked}" if asked else "")
        return
    for owed in block.owed:
        after = counts.name(owed.after.number)
        yield f"step {step.number}: {owed.questionnaire} after {after}"
    if block.unjudged:
        yield f"step {step.number}: judgement of {counts.name(block.unjudged)}"
    if block.trials:
        trials = counts.names(trial.number for trial in block.trials)
        yield f"step {step.number}: {step.kind} {block.name!r}, {trials}"


def done_before(whole: SessionPlan, so_far: Progress, left: SessionPlan) -> int:
    """Return how many counted trials are over for good when what is ``left`` is begun."""
    again = {trial.number for block in left.blocks for trial in block.trials}
    return sum(trial.number in so_far.done and trial.number not in again for trial in whole.trials)


def within_limits(study: Study, angles: Sequence[float] | FloatArray) -> tuple[float, ...]:
    """Return recorded joint angles as a pose that the machine can be set to.

    An engine lets a joint stand a few hundredths of a degree beyond its limit; it is set to the
    limit.
    """
    lowest, highest = np.array(study.machine.limits).T
    return tuple(np.clip(angles, lowest, highest).tolist())
