"""Sentences that state events in plain words, with their kind and level."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from labcrane.core.events import KINDS
from labcrane.core.records import Event, Value
from labcrane.session.standing import EXAMINER, STOP

FILTERS = ("trials", "actions", "notes", "faults", "answers", "other")
"""What events can be filtered by."""

MOST = 300
"""Characters of a sentence; the raw data has the rest."""

INSTRUCTIONS = "instructions"
"""What waits while the operator reads: its text is shown already."""

Data = Mapping[str, Value]


@dataclass(frozen=True, slots=True)
class Sentence:
    """An event in words.

    Attributes
    ----------
    kind
        One of :data:`FILTERS`.
    level
        ``"bad"`` if the experimenter must act, ``"warn"`` if the experimenter should know.
    """

    text: str
    kind: str
    level: str = ""


def sentence(event: Event, called: Callable[[int], str]) -> Sentence:
    """Return an event in words.

    ``called`` says what a trial of the plan is called.
    """
    found = _sentence(event, called)
    text = found.text[:MOST]
    return Sentence(text[:1].upper() + text[1:], found.kind, found.level)


def met(data: Mapping[str, Value]) -> str:
    """Return a stop rule that was met in words: what is beyond which limit."""
    mean = f"the mean of {data.get('estimate')} over the trial"
    what = f"{data['questionnaire']} {data['score']}" if "questionnaire" in data else mean
    limit = " ".join(f"{key} {data[key]}" for key in ("above", "below") if key in data)
    return f"{what} is {_plain(data.get('value'))}, {limit}"


def _sentence(event: Event, called: Callable[[int], str]) -> Sentence:
    data = event.data
    if event.name == "waiting" and data.get("what") == INSTRUCTIONS:
        return Sentence("the operator reads the instructions", "other")
    said = KINDS.get(event.name)
    if said is not None and said.sentence and not data.get("refused"):
        return Sentence(said.sentence.format_map(_Told(data)), said.kind, said.level)
    match event.name:
        case "trial.start":
            again = f", attempt {data['attempt']}" if data.get("attempt", 1) != 1 else ""
            return Sentence(f"{_trial(data, called)} began{again}", "trials")
        case "trial.end":
            return Sentence(f"{_trial(data, called)} ended: {data.get('outcome')}", "trials")
        case "stop_rule.met":
            return Sentence(f"stop rule met: {met(data)}", "answers", "bad")
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
    named = {"trial": _trial(data, called)} if "trial" in data else {}
    about = ", ".join(
        str(value) if key == "trial" else f"{key} {_plain(value)}"
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


def _plain(value: Value) -> str:
    """Return a value with as many digits as people read; the raw data has all."""
    return f"{value:.6g}" if isinstance(value, float) else str(value)


class _Told(dict[str, Value]):
    """Data of an event; a value that an older session did not record is a question mark."""

    def __missing__(self, key: str) -> str:
        return "?"
