"""Pause of a session: held by the examiner, a part in trouble, or a stop rule."""

import json
from collections.abc import Callable, Iterable

from labcrane.core.records import Value
from labcrane.protocol.protocol import OnFault
from labcrane.session.commands import Command, Order

EXAMINER, INPUT, DISK, STOP = "examiner", "input", "disk", "stop rule"
"""Who can hold a session, beside lost streams and feedback: it goes on when nobody does."""


class Suspenders:
    """Holds a session while somebody or something has a reason to.

    Parameters
    ----------
    on_fault
        What the protocol wants done about each fault.
    note
        Takes an event's name and data; every reason that comes or goes is one.
    awaits
        Names of the views and sounds that are still to present their first frame.

    Attributes
    ----------
    awaited
        Those of them that have neither presented nor been left out.
    by
        Who holds the session.
    ending
        Why the session must end, reason by reason; empty while it may go on.
    """

    def __init__(
        self,
        on_fault: OnFault,
        note: Callable[[str, dict[str, Value]], None],
        awaits: Iterable[str] = (),
    ) -> None:
        self._on_fault = on_fault
        self._note = note
        self.by: set[str] = set()
        self.ending: list[str] = []
        self.awaited = set(awaits)
        for name in sorted(self.awaited):
            note("feedback.awaited", {"what": name})

    def __contains__(self, who: str) -> bool:
        return who in self.by

    def hold(self, who: str) -> None:
        """Hold the session for ``who``."""
        self.by.add(who)
        self._note("pause.start", {"by": who})

    def release(self, who: str) -> None:
        """Let the session go on as far as ``who`` is concerned."""
        if who in self.by:
            self.by.discard(who)
            self._note("pause.end", {"by": who})

    def watch(self, part: str, trouble: str | None) -> None:
        """Hold the session while a part is in trouble; None is none."""
        held = part in self.by
        if trouble is not None and not held:
            self._note(f"{part}.lost", {"why": trouble})
            self.hold(part)
            if part == INPUT and self._on_fault.input_lost == "end":
                self.ending.append("input lost")
        elif trouble is None and held:
            self._note(f"{part}.back", {})
            self.release(part)

    def report(self, command: Command) -> None:
        """Take up what the launcher says of a stream or a feedback process."""
        if command.order is Order.LOST:
            self._note("stream.lost", {"what": command.text})
            if self._on_fault.stream_lost == "pause":
                self.hold(command.text)
        elif command.order is Order.BACK:
            self._note("stream.back", {"what": command.text})
            self.release(command.text)
        elif command.order in {Order.SIGNAL_BAD, Order.SIGNAL_GOOD}:
            self._note(f"signal.{command.order.value.split()[1]}", json.loads(command.text))
        else:
            self._feedback(command)

    def _feedback(self, command: Command) -> None:
        name, _, why = command.text.partition(": ")
        who = f"feedback {name}"
        if command.order is Order.MENDED:
            self._note("feedback.ready", {"what": name, "facts": why})
            self.awaited.discard(name)
            self.release(who)
            return
        left_out = command.order is Order.LEFT_OUT
        self._note("feedback.lost", {"what": name, "why": why, "left_out": left_out})
        if left_out:
            self.awaited.discard(name)
        if self._on_fault.feedback_lost == "pause" and who not in self.by:
            self.hold(who)
