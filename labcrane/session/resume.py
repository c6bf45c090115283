"""Resume point: how far a session has come, and what is left of it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from labcrane.core.records import Phase, Trial, Value
from labcrane.design.plan import Owed, PlannedBlock, PlannedStep, SessionPlan, next_attempt
from labcrane.errors import ProtocolError
from labcrane.protocol.study import Study
from labcrane.recording.journal_reader import SessionLog, read_journal
from labcrane.recording.paths import parts

Policy = Literal["continue", "redo_trial", "redo_block"]


@dataclass
class Progress:
    """What a session's journals say of how far it came.

    Attributes
    ----------
    complete
        Whether it ran to its end.
    steps
        Numbers of the steps that are done.
    attempts
        The last attempt of every trial that was begun, by trial number.
    done
        Numbers of the trials that need no further attempt.
    interrupted
        What was said of the trial that was under way when the process died; None between trials.
    angles
        Last joint angles in rad, shape ``(n_joints,)``; empty when there is no frame.
    answers
        What was answered, by step and questionnaire.
    handed_in
        Steps and questionnaires that need not be asked again.
    rated, ratings
        The same of what is asked after trials, by trial and questionnaire.
    last
        Number of the last trial that ended; None before the first.
    """

    complete: bool = False
    steps: set[int] = field(default_factory=set)
    attempts: dict[int, int] = field(default_factory=dict)
    done: set[int] = field(default_factory=set)
    interrupted: Mapping[str, Any] | None = None
    angles: tuple[float, ...] = ()
    answers: dict[tuple[int, str], dict[str, Value]] = field(default_factory=dict)
    handed_in: set[tuple[int, str]] = field(default_factory=set)
    ratings: dict[tuple[int, str], dict[str, Value]] = field(default_factory=dict)
    rated: set[tuple[int, str]] = field(default_factory=set)
    last: int | None = None


def progress(journal: Path, joints: Sequence[str]) -> Progress:
    """Return how far the session with this journal, all its parts included, has come.

    Raises
    ------
    ProtocolError
        There is no such journal, so there is nothing to go on with.
    """
    found = parts(journal)
    if not found:
        raise ProtocolError(
            f"there is no journal {journal}, so there is no session to go on with; start one with "
            "labcrane run"
        )
    log, _ = read_journal(found)
    so_far = Progress(angles=_last_angles(log, joints))
    for event in log.events:
        _take(so_far, event.name, event.data)
    return so_far


def _take(so_far: Progress, name: str, data: Mapping[str, Any]) -> None:
    match name:
        case "session.end":
            so_far.complete = data["reason"] == "complete"
        case "step.end" if not so_far.complete:
            so_far.steps.add(data["step"])
        case "questionnaire.answer" if "trial" in data:
            rating = so_far.ratings.setdefault((data["trial"], data["questionnaire"]), {})
            rating[data["item"]] = data["value"]
        case "questionnaire.end" if "trial" in data:
            so_far.rated.add((data["trial"], data["questionnaire"]))
        case "questionnaire.answer":
            asked = so_far.answers.setdefault((data["step"], data["questionnaire"]), {})
            asked[data["item"]] = data["value"]
        case "questionnaire.end":
            so_far.handed_in.add((data["step"], data["questionnaire"]))
        case "trial.start":
            so_far.attempts[data["trial"]] = data["attempt"]
            so_far.interrupted = data
        case "trial.end":
            so_far.interrupted, so_far.last = None, data["trial"]
            again = {Phase.REPEATED, Phase.ENDED, Phase.INTERRUPTED}
            if data["outcome"] not in again:
                so_far.done.add(data["trial"])


def _last_angles(log: SessionLog, joints: Sequence[str]) -> tuple[float, ...]:
    columns = [log.column("state", f"joint.angle.{joint}") for joint in joints]
    whole = [column for column in columns if column is not None and len(column)]
    return tuple(float(column[-1]) for column in whole) if len(whole) == len(joints) else ()


def remaining(study: Study, plan: SessionPlan, so_far: Progress, policy: Policy) -> SessionPlan:
    """Return what is left of a plan.

    Steps that are done are left out. Of the block that was under way, the trials that are done are
    left out as well, unless the policy is to redo the block; the interrupted trial is redone unless
    the policy is to continue with the next one. What is run again is a new attempt.
    """
    steps = []
    for step in plan.steps:
        if step.number in so_far.steps:
            continue
        block = _rest(study, plan, step.block, so_far, policy) if step.block else None
        if step.block is None or (block and (block.trials or block.owed)):
            steps.append(_unasked(replace(step, block=block), so_far))
    return replace(plan, steps=tuple(steps))


def _unasked(step: PlannedStep, so_far: Progress) -> PlannedStep:
    """Return a step with the questionnaires that are left, and what was answered of them."""
    left = [name for name in step.questionnaires if (step.number, name) not in so_far.handed_in]
    answered = {name: so_far.answers.get((step.number, name), {}) for name in left}
    return replace(step, questionnaires=tuple(left), answered=answered)


def _rest(
    study: Study, plan: SessionPlan, block: PlannedBlock, so_far: Progress, policy: Policy
) -> PlannedBlock:
    begun = [trial for trial in block.trials if trial.number in so_far.attempts]
    if policy == "redo_block" and begun:
        attempt = 1 + max(so_far.attempts[trial.number] for trial in begun)
        again = [next_attempt(study, plan, trial, attempt) for trial in block.trials]
        return replace(block, trials=tuple(again))
    left: list[Trial] = []
    for trial in block.trials:
        if trial.number in so_far.done:
            continue
        if trial.number not in so_far.attempts:
            left.append(trial)
        elif policy != "continue":
            left.append(next_attempt(study, plan, trial, so_far.attempts[trial.number] + 1))
    return replace(block, trials=tuple(left), owed=_owed(block, so_far))


def _owed(block: PlannedBlock, so_far: Progress) -> tuple[Owed, ...]:
    """Return what was still to be asked after the last trial when the process died."""
    after = [
        trial
        for trial in block.trials
        if trial.number == so_far.last and trial.number in so_far.done and trial.planned.counted
    ]
    return tuple(
        Owed(trial, name, so_far.ratings.get((trial.number, name), {}))
        for trial in after
        for name in block.ask
        if (trial.number, name) not in so_far.rated
    )


def within_limits(study: Study, angles: Sequence[float]) -> tuple[float, ...]:
    """Return recorded joint angles as a pose that the machine can be set to.

    An engine lets a joint stand a few hundredths of a degree beyond its limit; it is set to the
    limit.
    """
    lowest, highest = np.array(study.machine.limits).T
    return tuple(np.clip(angles, lowest, highest).tolist())
