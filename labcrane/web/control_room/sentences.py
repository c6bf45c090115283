"""Sentences that state events in plain words, with their kind and level."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from labcrane.core.records import Event, Value
from labcrane.session.standing import EXAMINER, STOP

KINDS = ("trials", "actions", "notes", "faults", "answers", "other")
"""What events can be filtered by."""

MOST = 300
"""Characters of a sentence; the raw data has the rest."""

Data = Mapping[str, Value]


@dataclass(frozen=True, slots=True)
class Sentence:
    """An event in words.

    Attributes
    ----------
    kind
        One of :data:`KINDS`.
    level
        ``"bad"`` if the experimenter must act, ``"warn"`` if the experimenter should know.
    """

    text: str
    kind: str
    level: str = ""


SAID: Mapping[str, tuple[str, str, str]] = {
    "session.start": ("the session began", "other", ""),
    "session.resumed": ("the session continued", "other", ""),
    "session.standing": ("{done} trials were completed earlier", "other", ""),
    "session.end": ("the session ended: {reason}", "other", ""),
    "session.died": ("the session's process died in {where}", "faults", "bad"),
    "session.failed": ("the session failed: {why}", "faults", "bad"),
    "step.start": ("step {step} began: {kind}", "other", ""),
    "step.end": ("step {step} ended", "other", ""),
    "block.start": ("block {block} began: {block_name}", "trials", ""),
    "block.end": ("block {block} ended: {block_name}", "trials", ""),
    "practice.end": ("practice ended", "trials", ""),
    "waiting": ("ready to start: {what}", "other", ""),
    "judgement.awaited": ("waiting for the experimenter to judge the test", "trials", ""),
    "judgement.over": ("judging of the test ended", "trials", ""),
    "break.start": ("a break of {seconds} s began", "other", ""),
    "break.end": ("the break ended", "other", ""),
    "fixation.shown": ("fixation point {point} is shown", "other", ""),
    "fixation.over": ("fixation point {point} is hidden", "other", ""),
    "instructions.shown": ("instructions are shown", "other", ""),
    "scene.placed": ("the scene was set up", "other", ""),
    "consent.needed": ("waiting for consent to {file}", "answers", ""),
    "consent.asked": ("consent confirmation was requested", "answers", ""),
    "consent.given": ("consent was given", "answers", ""),
    "questionnaire.start": ("questionnaire shown: {title}", "answers", ""),
    "questionnaire.answer": ("{item} was answered: {value}", "answers", ""),
    "questionnaire.refused": ("an answer was not accepted: {why}", "answers", "warn"),
    "questionnaire.end": ("questionnaire {questionnaire} ended", "answers", ""),
    "order.note": ("note: {text}", "notes", ""),
    "order.hint": ("hint to the operator: {text}", "notes", ""),
    "feedback.setting": ("{feedback}.{key} was set to {value}", "actions", ""),
    "feedback.awaited": ("waiting for {what}", "other", ""),
    "feedback.ready": ("{what} is ready", "other", ""),
    "feedback.lost": ("{what} failed: {why}", "faults", "bad"),
    "stream.lost": ("stream {what} is lost", "faults", "bad"),
    "stream.confirmed": ("stream {what} is {which}", "other", ""),
    "stream.back": ("stream {what} is back", "faults", ""),
    "signal.bad": ("signal of {stream} {channel}: {message}", "faults", "warn"),
    "signal.good": ("signal of {stream} {channel} has recovered", "faults", ""),
    "input.lost": ("the controls are lost: {why}", "faults", "bad"),
    "input.back": ("the controls are back", "faults", ""),
    "disk.lost": ("the disk accepts no data: {why}", "faults", "bad"),
    "disk.back": ("the disk accepts data again", "faults", ""),
    "trigger.lost": ("trigger {why}", "faults", "bad"),
    "trigger.flood": ("trigger {why}", "faults", "bad"),
    "trigger.back": ("trigger {trigger} is back", "faults", ""),
    "plugin.slow": ("slow call: {why}", "faults", "warn"),
    "page.denied": ("refused: {why}", "faults", "warn"),
    "launcher.gone": ("the launcher died: the session ends", "faults", "bad"),
    "participant.dropout": ("the participant dropped out: {why}", "other", "warn"),
}
"""The words for an event, its kind and its level."""


def sentence(event: Event, called: Callable[[int], str]) -> Sentence:
    """Return an event in words.

    ``called`` says what a trial of the plan is called.
    """
    found = _sentence(event, called)
    text = found.text[:MOST]
    return Sentence(text[:1].upper() + text[1:], found.kind, found.level)


def _sentence(event: Event, called: Callable[[int], str]) -> Sentence:
    data = event.data
    if (said := SAID.get(event.name)) and not data.get("refused"):
        words, kind, level = said
        return Sentence(words.format_map(_Told(data)), kind, level)
    match event.name:
        case "trial.start":
            again = f", attempt {data['attempt']}" if data.get("attempt", 1) != 1 else ""
            return Sentence(f"{_trial(data, called)} began{again}", "trials")
        case "trial.end":
            return Sentence(f"{_trial(data, called)} ended: {data.get('outcome')}", "trials")
        case "pause.start":
            mine = data.get("by") == EXAMINER
            return Sentence(
                held(str(data.get("by"))), "actions" if mine else "faults", "" if mine else "warn"
            )
        case "pause.end":
            return Sentence(f"no longer {held(str(data.get('by')))}", "other")
    part, _, what = event.name.partition(".")
    if part == "order":
        return _order(what, data)
    if part == "stop_rule":
        return Sentence(
            f"stop rule met: {data.get('questionnaire')} {data.get('score')} is "
            f"{data.get('value')}, above {data.get('above')}", "answers", "bad",
        )  # fmt: skip
    named = {"trial": _trial(data, called)} if "trial" in data else {}
    about = ", ".join(
        str(value) if key == "trial" else f"{key} {value}"
        for key, value in {**data, **named}.items()
        if value not in {None, ""}
    )
    return Sentence(f"{event.name.replace('.', ' ').replace('_', ' ')}: {about}", "other")


def held(by: str) -> str:
    """Return in words that a session is paused or stopped, and by whom or what."""
    if by == EXAMINER:
        return "paused by you"
    return f"paused by a {by}" if by == STOP else f"stopped by a fault: {by}"


def _order(what: str, data: Data) -> Sentence:
    words = f" {data['text']}" if data.get("text") else ""
    who = "experimenter" if data.get("by") == "supervisor" else data.get("by")
    by = f" by {who}" if who else ""
    kind = "notes" if what in {"note", "hint"} else "actions"
    if data.get("refused"):
        return Sentence(f"{what}{words} was refused: {data['refused']}", kind, "warn")
    return Sentence(f"{what}{words} was requested{by}", kind)


def _trial(data: Data, called: Callable[[int], str]) -> str:
    return called(int(str(data.get("trial", 0))))


class _Told(dict[str, Value]):
    """Data of an event; a value that an older session did not record is a question mark."""

    def __missing__(self, key: str) -> str:
        return "?"
