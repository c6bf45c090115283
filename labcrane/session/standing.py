"""Standing of a session: what runs, who holds it, and which orders make sense now.

It follows from the session's events alone, so that the sequencer, every page and every terminal
that hear them have the same, and one rule says what can be ordered: two rules had drifted apart.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any

from labcrane.session.commands import Order

EXAMINER, STOP = "examiner", "stop rule"
"""Holds that only the experimenter can end, also after a resumption."""


class SessionStage(StrEnum):
    """What runs in a session, whether or not it is held."""

    STARTING = "starting"  # nothing has begun: streams and feedback are awaited
    CONSENT = "consent"  # the participant's consent is awaited before it begins
    WAITING = "waiting"  # a step waits for the order to start
    TRIAL = "trial"
    JUDGEMENT = "judgement"  # a test has ended and can be judged
    BREAK = "break"
    FIXATION = "fixation"
    QUESTIONNAIRE = "questionnaire"
    BETWEEN = "between"  # steps or trials; here a session waits for feedback, or for a decision
    ENDED = "ended"


RUNS: Mapping[str, SessionStage] = {
    "consent.needed": SessionStage.CONSENT,
    "consent.given": SessionStage.STARTING,
    "waiting": SessionStage.WAITING,
    "trial.start": SessionStage.TRIAL,
    "judgement.awaited": SessionStage.JUDGEMENT,
    "break.start": SessionStage.BREAK,
    "fixation.shown": SessionStage.FIXATION,
    "questionnaire.start": SessionStage.QUESTIONNAIRE,
    **dict.fromkeys(
        ("step.start", "trial.end", "judgement.over", "break.end", "questionnaire.end", "step.end"),
        SessionStage.BETWEEN,
    ),
    "session.end": SessionStage.ENDED,
}
"""What runs after each of these events."""

SKIPPABLE = {
    SessionStage.TRIAL,
    SessionStage.BREAK,
    SessionStage.FIXATION,
    SessionStage.QUESTIONNAIRE,
}
"""What can be skipped."""

ENDED = "the session has ended"
NOT_BEGUN = "the session has not begun; order it again when it has"
NO_TRIAL = "no trial is running"


@dataclass(frozen=True, slots=True)
class Standing:
    """Where a session stands.

    Attributes
    ----------
    stage
        What runs in it.
    what
        What waits to be started, if something does.
    kind, step
        Kind and number of the step that runs.
    done
        Number of the step that was done last.
    holds
        Who and what holds it.
    trial
        What is known of the running trial, as of ``trial.start``; empty for none.
    last
        What is known of the trial that ended last, its number and attempt at least.
    awaited
        Views and sounds that have yet to present.
    failed
        Views and sounds that have failed and are not back; True for one that is left out.
    """

    stage: SessionStage = SessionStage.STARTING
    what: str = ""
    kind: str = ""
    step: int = 0
    done: int = 0
    holds: frozenset[str] = frozenset()
    trial: Mapping[str, Any] = field(default_factory=dict)
    last: Mapping[str, Any] = field(default_factory=dict)
    awaited: frozenset[str] = frozenset()
    failed: Mapping[str, bool] = field(default_factory=dict)

    @property
    def paused(self) -> bool:
        """Whether it waits for people to let it go on."""
        return bool(self.holds & {EXAMINER, STOP})

    def after(self, name: str, data: Mapping[str, Any]) -> "Standing":
        """Return where the session stands after an event."""
        now = self._held(name, data)
        if name in RUNS:
            now = now.at(RUNS[name])
        match name:
            case "step.start":
                return replace(now, kind=str(data["kind"]), step=int(data["step"]))
            case "step.end" if data["done"]:
                return replace(now, done=int(data["step"]))
            case "waiting":
                return replace(now, what=str(data["what"]))
            case "order.start" if data["refused"] is None and not self.paused:
                return now.at(
                    SessionStage.FIXATION if self.kind == "fixation" else SessionStage.BETWEEN
                )
            case "trial.start":
                return replace(now, trial=data)
            case "trial.end":
                return replace(now, trial={}, last=data)
            case "judgement.awaited" | "session.standing" if "trial" in data:
                return replace(now, last=self.last or data)  # it may have ended before a resume
        return now

    def at(self, stage: SessionStage) -> "Standing":
        """Return the standing with something else running in it."""
        return replace(self, stage=stage, what="")

    def _held(self, name: str, data: Mapping[str, Any]) -> "Standing":
        """Return the standing after a hold or release, or after feedback came."""
        begun = self.at(SessionStage.BETWEEN) if self.stage is SessionStage.STARTING else self
        match name:
            case "pause.start":
                return replace(begun, holds=self.holds | {data["by"]})
            case "pause.end":
                return replace(self, holds=self.holds - {data["by"]})
            case "feedback.awaited":
                return replace(begun, awaited=self.awaited | {data["what"]})
            case "feedback.ready":
                failed = {name: out for name, out in self.failed.items() if name != data["what"]}
                return replace(self, awaited=self.awaited - {data["what"]}, failed=failed)
            case "feedback.lost":
                awaited = self.awaited - ({data["what"]} if data["left_out"] else set())
                failed = {**self.failed, data["what"]: bool(data["left_out"])}
                return replace(self, awaited=awaited, failed=failed)
            case "order.again" if data["refused"] is None:
                return replace(self, failed={**self.failed, data["text"]: False})
            case "order.without" if data["refused"] is None:
                return replace(self, awaited=self.awaited - {data["text"]})
        return self

    def why_not_about(self, order: Order, what: str) -> str | None:
        """Return why an order about a failed view or sound makes no sense now, or None."""
        if what not in self.failed:
            failed = ", ".join(sorted(self.failed)) or "none"
            return f"{order} names a view or sound that has failed ({failed}), not {what!r}"
        if order is Order.AGAIN and not self.failed[what]:
            return f"{what} is being started already"
        return None


def why_not(order: Order, standing: Standing) -> str | None:
    """Return why an order makes no sense now, or None when it does."""
    stage = standing.stage
    if stage is SessionStage.ENDED:
        return ENDED
    if stage in {SessionStage.STARTING, SessionStage.CONSENT} and order is not Order.END:
        return NOT_BEGUN
    faults = ", ".join(sorted(standing.holds - {EXAMINER, STOP}))
    match order:
        case Order.START if faults:
            return f"stopped by a fault, and a movement would be held: {faults}"
        case Order.START if (
            stage not in {SessionStage.WAITING, SessionStage.JUDGEMENT} and not standing.paused
        ):
            awaited = ", ".join(sorted(standing.awaited))
            return (
                f"the session is waiting for feedback {awaited}"
                if awaited
                else "nothing is waiting to start"
            )
        case Order.PAUSE if EXAMINER in standing.holds:
            return "the session is paused already"
        case Order.SKIP if stage not in SKIPPABLE:
            return "no trial, break or questionnaire is running"
        case Order.REPEAT | Order.REPORT if not standing.trial:
            return NO_TRIAL
        case Order.OVERRIDE | Order.COMPLETION if not (standing.trial or standing.last):
            return "no trial is running or has ended"
    return None
