"""Sentences that tell events to people, and what kind of news each is."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from labcrane.core.records import Event, Value

KINDS = ("trials", "orders", "notes", "faults", "answers", "other")
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
        ``"bad"`` for what somebody has to see to, ``"warn"`` for what somebody should know.
    """

    text: str
    kind: str
    level: str = ""


SAID: Mapping[str, tuple[str, str, str]] = {
    "session.start": ("the session began", "other", ""),
    "session.resumed": ("the session goes on", "other", ""),
    "session.standing": ("{done} trials were done before", "other", ""),
    "session.end": ("the session ended: {reason}", "other", ""),
    "session.died": ("the session's process died in {where}", "faults", "bad"),
    "session.failed": ("the session failed: {why}", "faults", "bad"),
    "step.start": ("step {step} began: {kind}", "other", ""),
    "step.end": ("step {step} is over", "other", ""),
    "block.start": ("block {block} began: {block_name}", "trials", ""),
    "block.end": ("block {block} is over: {block_name}", "trials", ""),
    "practice.end": ("practice is over", "trials", ""),
    "waiting": ("waits to be started: {what}", "other", ""),
    "judgement.awaited": ("the test can be judged before the session goes on", "trials", ""),
    "judgement.over": ("the test stays as it was judged", "trials", ""),
    "break.start": ("a break of {seconds} s began", "other", ""),
    "break.end": ("the break is over", "other", ""),
    "fixation.shown": ("point {point} is to be looked at", "other", ""),
    "fixation.over": ("point {point} is gone", "other", ""),
    "instructions.shown": ("instructions are shown", "other", ""),
    "scene.placed": ("the scene was set up", "other", ""),
    "consent.needed": ("consent to {file} is asked for", "answers", ""),
    "consent.asked": ("consent is confirmed", "answers", ""),
    "consent.given": ("consent was given", "answers", ""),
    "questionnaire.start": ("questionnaire asked: {title}", "answers", ""),
    "questionnaire.answer": ("{item} was answered: {value}", "answers", ""),
    "questionnaire.refused": ("an answer was not taken: {why}", "answers", "warn"),
    "questionnaire.end": ("questionnaire {questionnaire} is over", "answers", ""),
    "pause.end": ("no longer held by {by}", "other", ""),
    "order.note": ("note: {text}", "notes", ""),
    "order.hint": ("hint to the operator: {text}", "notes", ""),
    "feedback.setting": ("{feedback}.{key} was set to {value}", "orders", ""),
    "feedback.awaited": ("{what} is waited for", "other", ""),
    "feedback.ready": ("{what} presents", "other", ""),
    "feedback.lost": ("{what} failed: {why}", "faults", "bad"),
    "stream.lost": ("stream {what} is lost", "faults", "bad"),
    "stream.confirmed": ("stream {what} is {which}", "other", ""),
    "stream.back": ("stream {what} is back", "faults", ""),
    "signal.bad": ("signal of {stream} {channel}: {message}", "faults", "warn"),
    "signal.good": ("signal of {stream} {channel} is well again", "faults", ""),
    "input.lost": ("the controls are lost: {why}", "faults", "bad"),
    "input.back": ("the controls are back", "faults", ""),
    "disk.lost": ("the disk takes nothing: {why}", "faults", "bad"),
    "disk.back": ("the disk takes data again", "faults", ""),
    "trigger.lost": ("trigger {why}", "faults", "bad"),
    "trigger.flood": ("trigger {why}", "faults", "bad"),
    "trigger.back": ("trigger {trigger} is back", "faults", ""),
    "plugin.slow": ("slow call: {why}", "faults", "warn"),
    "page.denied": ("refused: {why}", "faults", "warn"),
    "launcher.gone": ("the launcher is gone: the session ends", "faults", "bad"),
    "participant.dropout": ("the participant stops: {why}", "other", "warn"),
}
"""What is said of an event, its kind and its level."""


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
            by = data.get("by")
            mine = by == "examiner"
            return Sentence(
                f"held by {'you' if mine else by}", "orders" if mine else "faults",
                "" if mine else "warn",
            )  # fmt: skip
    part, _, what = event.name.partition(".")
    if part == "order":
        return _order(what, data)
    if part == "stop_rule":
        return Sentence(
            f"a stop rule is met: {data.get('questionnaire')} {data.get('score')} is "
            f"{data.get('value')}, above {data.get('above')}", "answers", "bad",
        )  # fmt: skip
    named = {"trial": _trial(data, called)} if "trial" in data else {}
    about = ", ".join(
        str(value) if key == "trial" else f"{key} {value}"
        for key, value in {**data, **named}.items()
        if value not in {None, ""}
    )
    return Sentence(f"{event.name.replace('.', ' ').replace('_', ' ')}: {about}", "other")


def _order(what: str, data: Data) -> Sentence:
    words = f" {data['text']}" if data.get("text") else ""
    by = f" by {data['by']}" if data.get("by") else ""
    kind = "notes" if what in {"note", "hint"} else "orders"
    if data.get("refused"):
        return Sentence(f"{what}{words} was refused: {data['refused']}", kind, "warn")
    return Sentence(f"{what}{words} was ordered{by}", kind)


def _trial(data: Data, called: Callable[[int], str]) -> str:
    return called(int(str(data.get("trial", 0))))


class _Told(dict[str, Value]):
    """Data of an event; what an older session did not say is a question mark."""

    def __missing__(self, key: str) -> str:
        return "?"
