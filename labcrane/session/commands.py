"""Commands of the people in the room, and what the session tells them."""

import queue
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

from labcrane.core.records import Event


class Order(StrEnum):
    """Everything that can be asked of a running session."""

    START = "start"  # begin the step that waits, or go on after a pause
    PAUSE = "pause"
    REPEAT = "repeat"  # end the running trial and run it again as a new attempt
    SKIP = "skip"  # end the running trial, or the break, and go on
    END = "end"  # end the session
    NOTE = "note"  # put words into the record
    OVERRIDE = "override"  # let the running trial go on past its automatic ends
    COMPLETION = "completion"  # set the completion flag of the running trial: 1 or 0
    HINT = "hint"  # show words to the operator
    ANSWER = "answer"  # to a question, as JSON: questionnaire, item, value
    SUBMIT = "submit"  # hand in the questionnaire that is asked
    CONSENT = "consent"  # to the text of this version, given before the session begins
    DENIED = "denied"  # said by a page: somebody without the right asked for something
    SETTING = "setting"  # change a setting of a cue or sound: tone.far=3
    FAILED = "failed"  # said by the launcher of a view or sound: tone: why
    LEFT_OUT = "left out"  # and of one that is not started again
    MENDED = "mended"  # and of one that presents
    LOST = "lost"  # said by the launcher: a stream or the recorder failed
    BACK = "back"  # and works again
    SIGNAL_BAD = "signal bad"  # and of a signal, as JSON: stream, channel, kind, message
    SIGNAL_GOOD = "signal good"  # and of one that is well again


FAULTS = frozenset(
    {
        Order.LOST,
        Order.BACK,
        Order.FAILED,
        Order.LEFT_OUT,
        Order.MENDED,
        Order.SIGNAL_BAD,
        Order.SIGNAL_GOOD,
    }
)
"""What the launcher says, not people."""


@dataclass(frozen=True, slots=True)
class Command:
    """One order, with its words if it has any."""

    order: Order
    text: str = ""
    by: str = ""  # which page; empty for the terminal


def by_whom(command: Command) -> str:
    """Return who gave an order: a page by its name, or the terminal."""
    return command.by or "terminal"


class Console(Protocol):
    """Whoever gives orders and looks on: the terminal and the pages, or a simulation."""

    def commands(self) -> list[Command]:
        """Return the orders given since the last call, without waiting."""
        ...

    def report(self, event: Event) -> None:
        """Be told of an event, without making the session wait."""
        ...


class QueueConsole:
    """Carries orders and events between threads; listeners must not wait."""

    def __init__(self) -> None:
        self._orders: queue.SimpleQueue[Command] = queue.SimpleQueue()
        self.events: queue.SimpleQueue[Event | None] = queue.SimpleQueue()
        self.listeners: list[Callable[[Event], None]] = []

    def give(self, command: Command) -> None:
        """Give an order; the session takes it up at its next tick."""
        self._orders.put(command)

    def commands(self) -> list[Command]:
        if self._orders.empty():  # the usual tick
            return []
        given = []
        while not self._orders.empty():
            given.append(self._orders.get_nowait())
        return given

    def report(self, event: Event) -> None:
        self.events.put(event)
        for listen in self.listeners:
            listen(event)
