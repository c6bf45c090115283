"""Messages to a session: what people order, and what processes report; and what it tells them.

A message crosses to the session's process as JSON of a declared size, and is read back by its
types, so that nothing else can come out there.
"""

import queue
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Annotated, Literal, Protocol

from pydantic import Field, TypeAdapter, ValidationError

from labcrane.core.records import Event, Value
from labcrane.errors import LabcraneError
from labcrane.limits import LIMITS, LimitError, check_text

MOST_BYTES = LIMITS["message to a session"].most
"""Size of the largest message to a session, as JSON: about forty pages of text."""


class Order(StrEnum):
    """Every action that a running session accepts."""

    START = "start"  # begin the step that waits, or go on after a pause
    PAUSE = "pause"
    REPEAT = "repeat"  # end the running trial and run it again as a new attempt
    SKIP = "skip"  # end the running trial, or the break, and go on
    END = "end"  # end the session
    NOTE = "note"  # put words into the record
    OVERRIDE = "override"  # let the running trial go on past its automatic ends
    COMPLETION = "completion"  # set the completion flag of the running trial: 1 or 0
    HINT = "hint"  # show words to the operator
    REPORT = "report"  # say that something was seen, of what the running task lists
    ANSWER = "answer"  # to a question, as JSON: questionnaire, item, value
    SUBMIT = "submit"  # submit the questionnaire that is shown
    CONSENT = "consent"  # to the text of this version, given before the session begins
    DENIED = "denied"  # from a page: a request without the right to make it
    SETTING = "setting"  # change a setting of a cue or sound: tone.far=3
    TAKE = "take"  # a stream that only its type asks for: eeg, eeg=amplifier-1 or eeg=none
    AGAIN = "again"  # start a view or sound again that is no longer started by itself: its name
    WITHOUT = "without"  # go on while a view or sound is not back: its name


KINDS = {
    Order.ANSWER: "answer",
    Order.NOTE: "note",
    Order.HINT: "hint",
    Order.SETTING: "setting",
}
"""Which of the limits holds for an order's words; that of an order for the rest."""


@dataclass(frozen=True, slots=True)
class Command:
    """One order as it was given, with its text if it has any; :func:`read_request` reads it."""

    order: Order
    text: str = ""
    by: str = ""
    """Which page; empty for the terminal."""
    at: str = ""
    """The address from which a page asked."""
    kind: Literal["command"] = "command"
    """What messages to a session are told apart by."""


@dataclass(frozen=True, slots=True)
class Control:
    """To start, pause, repeat, skip, end or override: no words are needed."""

    order: Order


@dataclass(frozen=True, slots=True)
class Remark:
    """A note for the record, or a hint for the operator."""

    order: Literal[Order.NOTE, Order.HINT]
    text: str


@dataclass(frozen=True, slots=True)
class Completion:
    """Whether the running trial was completed."""

    completed: bool


@dataclass(frozen=True, slots=True)
class Sighting:
    """A sighting of something that the running task asks about."""

    what: str


@dataclass(frozen=True, slots=True)
class SettingChange:
    """A setting of a cue or sound, and the value that it is to have, as it was written."""

    feedback: str
    key: str
    written: str


@dataclass(frozen=True, slots=True)
class AnswerGiven:
    """An answer as JSON, which only the questionnaire that is asked can read."""

    text: str


@dataclass(frozen=True, slots=True)
class Submission:
    """The questionnaire that is shown is submitted."""


@dataclass(frozen=True, slots=True)
class AboutFailed:
    """What to do about a view or sound that has failed."""

    order: Literal[Order.AGAIN, Order.WITHOUT]
    what: str


@dataclass(frozen=True, slots=True)
class ConsentGiven:
    """Consent to a version of the text."""

    version: str


@dataclass(frozen=True, slots=True)
class Denial:
    """A request was refused before it reached the session."""

    why: str


@dataclass(frozen=True, slots=True)
class Malformed:
    """An order whose words do not say what it needs."""

    order: Order
    why: str


Request = (
    Control
    | Remark
    | Completion
    | Sighting
    | SettingChange
    | AnswerGiven
    | Submission
    | AboutFailed
    | ConsentGiven
    | Denial
    | Malformed
)
"""What an order asks for, read from its words once."""


OF_WORDS: Mapping[Order, Callable[[str], Request]] = {
    Order.ANSWER: AnswerGiven,
    Order.CONSENT: ConsentGiven,
    Order.DENIED: Denial,
    Order.REPORT: Sighting,
}
"""What orders ask for that are their words and nothing else."""


def read_request(command: Command) -> Request:
    """Return what an order asks for."""
    order, text = command.order, command.text
    match order:
        case Order.NOTE | Order.HINT:
            return Remark(order, text) if text else Malformed(order, f"a {order} needs words")
        case Order.COMPLETION:
            if text in {"0", "1"}:
                return Completion(text == "1")
            return Malformed(order, f"completion is 1 or 0, not {text!r}")
        case Order.SETTING:
            place, equals, written = text.partition("=")
            feedback, dot, key = place.strip().partition(".")
            if equals and dot:
                return SettingChange(feedback, key, written)
            return Malformed(order, f"a setting is written name.key=value, not {text!r}")
        case Order.SUBMIT:
            return Submission()
        case Order.AGAIN | Order.WITHOUT:
            return AboutFailed(order, text.strip())
        case Order.TAKE:
            return Malformed(order, "no stream is asked about")  # a launcher has taken it up
    return OF_WORDS[order](text) if order in OF_WORDS else Control(order)


@dataclass(frozen=True, slots=True)
class StreamLost:
    """An external stream, or the recorder of all of them, has failed."""

    what: str
    kind: Literal["stream lost"] = "stream lost"


@dataclass(frozen=True, slots=True)
class StreamBack:
    """It works again."""

    what: str
    kind: Literal["stream back"] = "stream back"


@dataclass(frozen=True, slots=True)
class StreamConfirmed:
    """A stream of a type was chosen: ``which``, in words."""

    what: str
    which: str
    by: str
    kind: Literal["stream confirmed"] = "stream confirmed"


@dataclass(frozen=True, slots=True)
class SignalReport:
    """A signal of a stream has gone bad, or is well again."""

    stream: str
    channel: str
    fault: str
    message: str
    bad: bool
    kind: Literal["signal"] = "signal"


@dataclass(frozen=True, slots=True)
class FeedbackLost:
    """A view or sound has failed: start ``attempt`` of ``attempts`` follows, or it is left out."""

    what: str
    why: str
    left_out: bool = False
    attempt: int = 0
    attempts: int = 0
    kind: Literal["feedback lost"] = "feedback lost"

    def __str__(self) -> str:
        then = f"start {self.attempt} of {self.attempts} follows" if self.attempt else ""
        then = "it is left out" if self.left_out else then
        return f"{self.what} failed: {self.why}" + (f"; {then}" if then else "")


@dataclass(frozen=True, slots=True)
class FeedbackReady:
    """A view or sound presents; ``facts`` is its own metadata."""

    what: str
    facts: str = ""
    kind: Literal["feedback ready"] = "feedback ready"

    def __str__(self) -> str:
        return f"{self.what} is ready" + (f": {self.facts}" if self.facts else "")


@dataclass(frozen=True, slots=True)
class EstimateFailed:
    """The process of an estimate has failed: ``why``, and what is done about it."""

    what: str
    why: str
    kind: Literal["estimate failed"] = "estimate failed"


@dataclass(frozen=True, slots=True)
class LauncherGone:
    """The launcher has died: the session could no longer be stopped, so it ends."""

    kind: Literal["launcher gone"] = "launcher gone"


ProcessReport = (
    StreamLost
    | StreamBack
    | StreamConfirmed
    | SignalReport
    | FeedbackLost
    | FeedbackReady
    | EstimateFailed
    | LauncherGone
)
"""What becomes of the other processes of a run: said by the launcher, not by people."""

Message = Command | ProcessReport


@dataclass(frozen=True, slots=True)
class StreamOffered:
    """A process of the run sends a stream: its description, so that nobody searches for it."""

    description: str
    kind: Literal["stream offered"] = "stream offered"


Sent = Message | StreamOffered
"""What goes to a session's process: messages to the session, and what only receivers need."""

# By its kind alone, so that nothing without one is a message: one kind has no other content.
MESSAGE: TypeAdapter[Sent] = TypeAdapter(Annotated[Sent, Field(discriminator="kind")])


class MessageError(LabcraneError):
    """Something that cannot be sent to a session."""


def encode(message: Sent) -> bytes:
    """Return a message as it crosses the pipe.

    Raises
    ------
    MessageError
        It is larger than a message may be.
    """
    # Half of a character that takes two cannot be written; it is shown as what it is.
    if isinstance(message, Command):
        text = message.text.encode("utf-8", "backslashreplace").decode("utf-8")
        message = replace(message, text=text)
    line = MESSAGE.dump_json(message)
    if len(line) > MOST_BYTES:
        what = message.order if isinstance(message, Command) else message.kind
        raise MessageError(
            f"{what}: {len(line):,} bytes, but a session accepts at most {MOST_BYTES:,}; shorten it"
        )
    return line


def decode(line: bytes) -> Sent:
    """Return the message that :func:`encode` wrote.

    Raises
    ------
    MessageError
        It is none.
    """
    try:
        return MESSAGE.validate_json(line)
    except ValidationError as error:
        raise MessageError(f"{len(line)} bytes that are not a message to a session") from error


def given_by(command: Command) -> str:
    """Return who gave an order: a page by its name, or the terminal."""
    return command.by or "terminal"


def given_from(command: Command) -> dict[str, Value]:
    """Return from which address a page ordered, as data of an event; nothing for the terminal."""
    return {"at": command.at} if command.at else {}


def beyond_limits(command: Command) -> str | None:
    """Return why an order's words may not enter, or None when they may."""
    try:
        check_text(command.text, KINDS.get(command.order, "order"))
    except LimitError as error:
        return str(error)
    return None


class Console(Protocol):
    """A source of actions that also follows events: terminal and pages, or a simulation."""

    def commands(self) -> Sequence[Message]:
        """Return what was said since the last call, without waiting."""
        ...

    def report(self, event: Event) -> None:
        """Receive an event without making the session wait."""
        ...


class QueueConsole:
    """Carries orders and events between threads; listeners must not wait."""

    def __init__(self) -> None:
        self._orders: queue.SimpleQueue[Command] = queue.SimpleQueue()
        self.events: queue.SimpleQueue[Event | None] = queue.SimpleQueue()
        self.listeners: list[Callable[[Event], None]] = []

    def give(self, command: Command) -> None:
        """Give an order; the session takes it up at its next tick.

        What may not enter becomes the news that it was refused: it never reaches a pipe.
        """
        why = beyond_limits(command)
        if why is not None:
            why = f"{command.order.value}: {why}"
            command = Command(Order.DENIED, why, given_by(command), command.at)
        self._orders.put(command)

    def commands(self) -> list[Command]:
        """Return the orders that were given since the last call."""
        if self._orders.empty():  # the usual tick
            return []
        given = []
        while not self._orders.empty():
            given.append(self._orders.get_nowait())
        return given

    def report(self, event: Event) -> None:
        """Put an event into the queue, and hand it to each listener."""
        self.events.put(event)
        for listen in self.listeners:
            listen(event)
