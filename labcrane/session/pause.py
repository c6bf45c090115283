"""Pause of a session: by the experimenter, a fault, or a stop rule."""

from collections.abc import Callable, Iterable

from labcrane.core.records import Value
from labcrane.protocol.protocol import OnFault
from labcrane.session.commands import (
    EstimateFailed,
    FeedbackLost,
    FeedbackReady,
    LauncherGone,
    ProcessReport,
    SignalReport,
    StreamBack,
    StreamConfirmed,
    StreamLost,
)

INPUT, DISK = "input", "disk"
"""What can hold a session, in addition to people, lost streams and feedback."""


class Suspenders:
    """Holds a session while a person or a fault has a reason to.

    Parameters
    ----------
    on_fault
        What the protocol wants done about each fault.
    note
        Takes an event's name and data; every reason that comes or goes is one.
    awaits
        Names of the views and sounds that are still to present their first frame.
    people
        Whether a person operates, who would move without a view that never came.

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
        *,
        people: bool = False,
    ) -> None:
        self._on_fault = on_fault
        self._people = people
        self._note = note
        self.by: set[str] = set()
        self.ending: list[str] = []
        self.awaited = set(awaits)
        self._without: set[str] = set()  # views and sounds that are not waited for
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

    def report(self, report: ProcessReport) -> None:
        """Process the launcher's report about another process."""
        match report:
            case StreamLost(what):
                self._note("stream.lost", {"what": what})
                if self._on_fault.stream_lost == "pause":
                    self.hold(what)
            case StreamBack(what):
                self._note("stream.back", {"what": what})
                self.release(what)
            case StreamConfirmed(what, which, by):
                self._note("stream.confirmed", {"what": what, "which": which, "by": by})
            case SignalReport(stream, channel, fault, message, bad):
                about: dict[str, Value] = {"stream": stream, "channel": channel, "kind": fault}
                name = "signal.bad" if bad else "signal.good"
                self._note(name, about | ({"message": message} if bad else {}))
            case FeedbackReady(what, facts):
                self._note("feedback.ready", {"what": what, "facts": facts})
                self.awaited.discard(what)
                self.release(f"feedback {what}")
            case FeedbackLost():
                self._feedback_lost(report)
            case EstimateFailed(what, why):
                self._note("estimate.failed", {"estimate": what, "why": why})
            case LauncherGone():
                self._note("launcher.gone", {})
                self.ending.append("labcrane run was closed or killed")

    def decide(self, what: str, *, without: bool) -> None:
        """Go on without a view or sound that fails, or wait for it again where that was decided."""
        if not without:
            self._without.discard(what)
            return
        self.awaited.discard(what)
        self._without.add(what)
        self.release(f"feedback {what}")

    def _feedback_lost(self, lost: FeedbackLost) -> None:
        who = f"feedback {lost.what}"
        about: dict[str, Value] = {
            "what": lost.what, "why": lost.why, "left_out": lost.left_out,
            "attempt": lost.attempt, "attempts": lost.attempts,
        }  # fmt: skip
        self._note("feedback.lost", about)
        policy = self._on_fault.feedback_lost
        holds = policy == "pause"
        if lost.left_out and lost.what in self.awaited:
            self.awaited.discard(lost.what)
            holds |= self._people and policy != "continue"
        holds &= lost.what not in self._without
        if holds and who not in self.by:
            self.hold(who)
