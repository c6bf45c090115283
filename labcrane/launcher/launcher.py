"""Launcher of a run: starts, watches and restarts its processes.

The session process owns the loop, the recorder process the external streams. Either may die: the
recorder is restarted at once, and after the death of the session everything recorded is put into
the participant file, so that ``labcrane resume`` can continue the session.
"""

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any

from labcrane.capture.processes import RecordingProcesses, index_requests
from labcrane.core.records import Event
from labcrane.errors import StreamError
from labcrane.estimation.processes import EstimateProcesses, estimate_requests
from labcrane.feedback.processes import FeedbackProcesses, log_requests
from labcrane.launcher.hang_detector import HangDetector
from labcrane.launcher.session_handle import SessionHandle
from labcrane.launcher.session_process import Offered, SessionEnded
from labcrane.launcher.signal_reporter import SignalReporter, monitor_config
from labcrane.recording.crash_marker import read_crash_marker, take_crash_marker
from labcrane.recording.paths import parts
from labcrane.session.commands import (
    Command,
    LauncherGone,
    Message,
    Order,
    QueueConsole,
    Sent,
    StreamBack,
    StreamConfirmed,
    StreamLost,
    StreamOffered,
    given_by,
)
from labcrane.session.eligibility import Admission, check_eligibility, close_visit
from labcrane.session.session import finish, outlook, recording, running, still_owed
from labcrane.session.visit import Visit, claim
from labcrane.streams.recorder.handle import RecorderHandle
from labcrane.streams.sync.report.sync_report import SyncReport

LOOK_S = 0.05
"""How often the launcher looks after its processes: a dead recorder must be back in a second."""

RECORDER = "recorder"

FOR_THE_RECORD = (Order.NOTE, Order.DENIED)
"""Actions that are kept for the session while it waits for streams and feedback."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a run ended.

    Attributes
    ----------
    died
        Exit code of a session process that died; None when it ended in order.
    where
        The component that was running when it died; empty when that is unknown.
    sync_report
        Accuracy of the session's timestamps; None when nothing was recorded.
    owed
        The remaining trials of the session, as people count them; empty when it ran to its end or
        died.
    """

    died: int | None = None
    where: str = ""
    sync_report: SyncReport | None = None
    owed: str = ""


class Launcher:
    """Runs one visit.

    Parameters
    ----------
    console
        Takes actions from people, and receives every event.
    say
        Shows people the messages of the launcher itself.
    """

    def __init__(self, visit: Visit, console: QueueConsole, say: Callable[[str], None]) -> None:
        self._visit = visit
        self._console = console
        self._say = say
        self._recorder: RecorderHandle | None = None
        self._feedback: FeedbackProcesses | None = None
        self._recordings: RecordingProcesses | None = None
        self._estimates: EstimateProcesses | None = None
        self._lost: set[str] = set()
        self._described: set[str] = set()
        self._taken: set[str] = set()
        self._signals = SignalReporter(say)
        self._kept: list[Message] = []
        self._owes = False
        self.sync_report: SyncReport | None = None
        self.outcome: Outcome | None = None

    def run(self) -> Outcome:
        """Run the visit to its end and make its participant file.

        Raises
        ------
        LabcraneError
            The session could not be run, in the session process's own words.
        """
        visit = self._visit
        admission = check_eligibility(visit)
        for each in admission.otherwise_installed:
            self._say(f"since the approval, and recorded with the session: {each}")
        with running(visit):
            if visit.resumed:
                with recording(visit):  # of a launcher that died, the session may still be ending
                    ahead = outlook(visit, admission)
                self._say(ahead.text)
                now = time.perf_counter()
                standing = {"done": ahead.done, **ahead.unjudged}
                self._console.report(Event("session.standing", now, standing))
            else:
                claim(visit)
            return self._run_all(admission)

    def _run_all(self, admission: Admission) -> Outcome:
        visit = self._visit
        requests = [
            need.request(
                label, required=not visit.simulated, expected=visit.study.protocol.expected
            )
            for label, need in visit.study.protocol.streams.items()
        ]
        if visit.feedback:
            requests += log_requests(visit)
        requests += index_requests(visit) + estimate_requests(visit)
        if requests:
            self._recorder = RecorderHandle(visit.streams_journal, requests, monitor_config(visit))
        report = None
        try:
            if visit.feedback:
                self._feedback = FeedbackProcesses(visit)
            if visit.study.recordings:
                self._recordings = RecordingProcesses(visit)
            self._estimates = EstimateProcesses(visit)
            died = self._run() if self._gate() else None
        finally:
            if self._feedback:
                self._feedback.stop()
            if self._recordings:
                self._recordings.stop(self._say)
            if self._estimates is not None:
                self._estimates.stop()
            if self._recorder:
                self._recorder.stop()
            if parts(visit.journal):
                report = self.sync_report = finish(visit)
            else:
                close_visit(visit)  # it did not start: the register has no such session
        where = read_crash_marker(visit.crash_marker) if died is not None else None
        owed = still_owed(visit, admission) if self._owes and parts(visit.journal) else ""
        self.outcome = Outcome(died, str(where or ""), report, owed)
        return self.outcome

    @property
    def streams_status(self) -> dict[str, Any]:
        """The recorder's last status of the external streams; empty without any."""
        return self._recorder.status if self._recorder else {}

    def _gate(self) -> bool:
        """Wait until feedback is ready and all required streams flow; whether to start."""
        if self._feedback and not self._feedback.wait(self._say, self._told_to_end):
            return False
        recorder = self._recorder
        while not all(each.settled for each in (self._recordings, self._estimates) if each):
            self._watch_recordings()
            if self._told_to_end():
                return False
            time.sleep(LOOK_S)
        told: list[str] = []
        asked = not self._visit.simulated  # no person can answer, and nothing is required
        while recorder is not None and not (recorder.ready and not (asked and recorder.asks)):
            recorder.watch()
            self._watch_recordings()
            self._kept += self._signals.news(recorder)
            if recorder.complaints() != told:
                told = recorder.complaints()
                self._say("waiting for streams:\n" + "\n".join(f"  {line}" for line in told))
            if self._told_to_end():
                return False
            time.sleep(LOOK_S)
        self._say_what_was_taken()
        return True

    def _say_what_was_taken(self) -> None:
        """Say, once each, which stream was confirmed where any of its type would have fitted."""
        taken = self._recorder.taken() if self._recorder else []
        for line in taken:
            if line not in self._taken:
                self._taken.add(line)
                self._say(line)

    def _orders(self) -> list[Command]:
        """Return the actions of people, except those for the recorder, which are done here."""
        orders = self._console.commands()
        for command in orders:
            if command.order is Order.TAKE:
                self._confirm(command)
        return [command for command in orders if command.order is not Order.TAKE]

    def _confirm(self, command: Command) -> None:
        """Record the stream that a person has confirmed, and note that in the record."""
        if self._recorder is None:
            self._say("take: the study records no external streams")
            return
        try:
            what, which = self._recorder.confirm(command.text)
        except StreamError as error:
            self._say(str(error))
            return
        self._say(f"stream {what} is {which}")
        self._kept.append(StreamConfirmed(what, which, given_by(command)))

    def _pass_orders(self, session: SessionHandle) -> None:
        orders = self._orders()
        for message in (*self._kept, *orders):
            if isinstance(message, Command) and message.order is Order.AGAIN and self._feedback:
                self._feedback.again(message.text.strip())  # the session refuses another name
            session.send(message)
        self._kept.clear()

    def _told_to_end(self) -> bool:
        """Whether the run is to end before it has begun; what is for the record is kept for it."""
        for command in self._orders():
            if command.order is Order.END:
                return True
            if command.order in FOR_THE_RECORD:
                self._kept.append(command)
            else:
                early = "the session has not begun; order it again when it has"
                self._say(f"{command.order}: {early}")
        return False

    def _run(self) -> int | None:
        # What a process that died has left would look as if the new one hung in its beginning.
        died = take_crash_marker(self._visit.crash_marker)
        session = SessionHandle(replace(self._visit, died=died), self._say)
        try:
            return self._watch(session)
        finally:
            session.send(LauncherGone())  # if it still runs, nobody looks after it any more
            session.close()

    def _watch(self, session: SessionHandle) -> int | None:
        """Return the exit code of a session that died, None of one that ended in order."""
        detector = HangDetector(self._visit.crash_marker, self._say)
        while True:
            over = session.ended  # asked first: what it said before is taken below
            try:
                self._pass_orders(session)
                messages = session.wait(0.0 if over else LOOK_S)
            except KeyboardInterrupt:
                session.send(Command(Order.END))
                continue
            ended = self._pass_events(messages)
            if ended is not None:
                if ended.error is not None:
                    raise ended.error
                return None
            if over:
                return session.close()
            if detector.hangs():
                session.kill()  # its journal is whole; the exit code is passed on as any other
            self._watch_streams(session.send)
            self._watch_recordings()
            self._offer_estimates(session.send)
            if self._feedback:
                for news in self._feedback.watch(self._say):
                    session.send(news)

    def _pass_events(
        self, messages: Iterable[Event | Offered | SessionEnded]
    ) -> SessionEnded | None:
        for message in messages:
            if isinstance(message, SessionEnded):
                return message
            if isinstance(message, Offered):
                if self._feedback:
                    self._feedback.offer(message.streams)
                continue
            if message.name == "session.end":
                self._owes = bool(message.data["owed"])
            self._console.report(message)
        return None

    def _watch_recordings(self) -> None:
        """Start failed recordings and estimates again, and tell each which streams there are."""
        if self._recordings and self._recorder:
            self._recordings.watch(self._say)
            self._recorder.offer(self._recordings.sends)
        if self._estimates is not None and self._recorder and self._visit.study.estimates:
            streams = self._recorder.status.get("streams", ())
            self._kept += self._estimates.watch(streams, self._say)
            self._recorder.offer(self._estimates.sends)

    def _offer_estimates(self, send: Callable[[Sent], None]) -> None:
        """Describe new streams of values to the session: no search finds them for certain."""
        sends = self._estimates.sends if self._estimates is not None else ()
        for description in set(sends) - self._described:
            self._described.add(description)
            send(StreamOffered(description))

    def _watch_streams(self, send: Callable[[Message], None]) -> None:
        recorder = self._recorder
        if recorder is None:
            return
        if self._feedback:
            recorder.offer(self._feedback.sends)
        if recorder.watch():
            self._say("a recorder died: the other one has all streams, and a new one was started")
        for news in self._signals.news(recorder):
            send(news)
        self._say_what_was_taken()
        lost = recorder.lost() if recorder.status else {RECORDER}
        for what in sorted(lost - self._lost):
            send(StreamLost(what))
        for what in sorted(self._lost - lost):
            send(StreamBack(what))
        if lost != self._lost and lost:
            for line in recorder.complaints():
                self._say(line)
        self._lost = lost
