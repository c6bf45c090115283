"""Session: the rig is opened, led through its plan, and leaves a participant file."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from labcrane.core.clock import Clock, ManualClock, SystemClock
from labcrane.core.garbage import settled
from labcrane.core.records import Event, Frame, Phase, Run, Value
from labcrane.core.roles import Trigger
from labcrane.design.counts import TrialCounts
from labcrane.design.plan import SessionPlan, plan_session
from labcrane.design.tracks import Response
from labcrane.doctor.scheduling import lateness
from labcrane.errors import DeviceError, PluginError, ProtocolError
from labcrane.files.lock import held
from labcrane.processes.real_time import real_time
from labcrane.processes.wake_lock import wake_lock
from labcrane.protocol.rig import Rig
from labcrane.recording.crash_marker import CrashMarker, clear, read_crash_marker
from labcrane.recording.frame_log import BatchLog, FrameLog, columns, frame_bytes
from labcrane.recording.journal import SessionJournal
from labcrane.recording.participant_file.writer import consolidate
from labcrane.recording.paths import journal_path, next_part, parts
from labcrane.registry.proxies import loosely_watched
from labcrane.session import loop
from labcrane.session.commands import Console
from labcrane.session.eligibility import Admission, check_eligibility, close_visit
from labcrane.session.estimates import reporters
from labcrane.session.metadata import context
from labcrane.session.overruns import OverrunReporter
from labcrane.session.postprocess import conclude
from labcrane.session.resume import (
    INCOMPLETE,
    Ledger,
    Policy,
    Progress,
    carry,
    check_recorded,
    done_before,
    owed_text,
    progress,
    remaining,
    repeats,
    resumption,
    within_limits,
)
from labcrane.session.sequencer import Sequencer
from labcrane.session.visit import Visit, claim
from labcrane.streams.sync.report.sync_report import SyncReport

MEASURED_S = 1.0
"""How long an empty loop is measured, before a loop in real time."""

TRIGGERS = "triggers."
"""How the parts begin that a study's triggers play."""

RESERVE_S = 60.0
"""Seconds of recording for which the disk must always have room; below it the session pauses."""


ForwardMaker = Callable[[Rig, Run, Sequencer, BatchLog], loop.Forward]
"""Makes what goes forward through the ticks of a simulation, from its open rig."""


def run(visit: Visit, console: Console, forward: ForwardMaker | None = None) -> Path:
    """Record a session in this process and consolidate it; return the participant file.

    Whatever ends it, what was recorded until then is in the file.

    Parameters
    ----------
    forward
        For sessions on a clock that jumps.
    """
    check_eligibility(visit)
    with running(visit):
        try:
            record(visit, console, forward=forward)
        finally:
            if parts(visit.journal):
                finish(visit)
    return visit.folder.participant_file


LEAVING_S = 10.0
"""How long a session process may take to end when its launcher has died."""


def running(visit: Visit) -> AbstractContextManager[None]:
    """Lock this participant against other sessions, from the start of this one to its file.

    Raises
    ------
    RecordingError
        Another process runs one.
    """
    return _sole(visit, ".run.lock", 0.0)


def check_free(visit: Visit) -> None:
    """Make sure that no other process runs a session of this participant now.

    Raises
    ------
    RecordingError
        Another process runs one.
    """
    if visit.folder.path.is_dir():
        with running(visit):
            pass


def recording(visit: Visit) -> AbstractContextManager[None]:
    """Lock this participant against other recordings; wait for a process whose launcher died.

    Raises
    ------
    RecordingError
        Another process records, and does not end.
    """
    return _sole(visit, ".recording.lock", LEAVING_S)


def _sole(visit: Visit, name: str, patience_s: float) -> AbstractContextManager[None]:
    folder = visit.folder
    visit.study.check_participant(visit.participant)
    if not visit.resumed:
        folder.make()
    elif not folder.path.is_dir():
        return nullcontext()  # nothing to continue, which another check reports
    refusal = (
        f"another labcrane is running a session of {folder.name}; wait until it has ended, or end "
        "it, and try again"
    )
    return held(folder.path / name, refusal, patience_s)


def finish(visit: Visit) -> SyncReport:
    """Put what the journals hold into the participant file, with clocks corrected and judged.

    Returns the session's sync report.
    """
    journals = [first for first in (visit.journal, visit.streams_journal) if parts(first)]
    made: list[SyncReport] = []
    consolidate(visit.folder.participant_file, journals, lambda group: made.append(conclude(group)))
    close_visit(visit)
    return made[-1]


def record(
    visit: Visit,
    console: Console,
    offer: Callable[[Mapping[str, str]], None] | None = None,
    forward: ForwardMaker | None = None,
) -> None:
    """Run a session to its end and write its journal.

    Parameters
    ----------
    offer
        Is told the streams of frames and context, by name and description, once they are there.
    forward
        As of :func:`run`.

    Raises
    ------
    ProtocolError, DeviceError, RecordingError
        Before anything is recorded: the session cannot be run.
    """
    study = visit.study
    admission = check_eligibility(visit)
    whole = plan_session(study, visit.participant, visit.session, admission.slot)
    with recording(visit):
        _record(visit, console, admission, whole, offer, forward)


def _record(
    visit: Visit,
    console: Console,
    admission: Admission,
    whole: SessionPlan,
    offer: Callable[[Mapping[str, str]], None] | None,
    forward: ForwardMaker | None,
) -> None:
    study = visit.study
    so_far, plan = go_on(visit, whole) if visit.resumed else (None, whole)
    if so_far is None:
        claim(visit)
    carried = _carried(visit) if so_far is None else so_far.carried
    source = "" if visit.fast else visit.source
    rig = Rig.build(study, simulated=visit.simulated, source=source)
    clock = _clock(visit, so_far)
    died = visit.died or read_crash_marker(visit.crash_marker) if visit.resumed else None
    with (
        _scheduled(visit) as scheduling,
        _awake(visit) as awake,
        _watching(visit, rig),
        rig.opened(study, plan.seed) as run,
    ):
        if so_far is not None and so_far.angles:
            rig.dynamics.reset(within_limits(study, so_far.angles))
        second = frame_bytes(run) * run.rate_hz
        visit.folder.check_space(plan.expected_s, second, RESERVE_S)
        about = context(visit, whole, rig, run) | admission.context | scheduling | awake
        if study.protocol.design.tracks:
            about["carried"] = [asdict(each) for each in carried]
        awaits = (*study.views, *study.sounds) if visit.feedback else ()
        opening = list(_opening(about, so_far, died, clock.now()))
        if so_far is not None:
            resumed = resumption(plan, so_far, policy_of(visit))
            opening.append(Event("session.resumed", clock.now(), resumed))
        ledger = Ledger(study, whole, so_far)
        for event in opening:
            ledger.take(event.name, event.data)
        done = done_before(whole, so_far, plan) if so_far is not None else 0
        waits = not visit.simulated
        sequencer = Sequencer(study, plan, rig, waits=waits, awaits=awaits, ledger=ledger)
        log = _log(visit, run, clock, reserve=round(RESERVE_S * second))
        try:
            for event in opening:
                log.note(event)
            with (
                _triggers(visit, run, log, console) as triggers,
                _outlets(visit, whole, done, run, offer) as outlets,
            ):
                estimates = reporters(study.estimates, run.axes, log, console)
                sinks = [*triggers, *outlets, *estimates, _teller(console)]
                if not visit.fast:
                    sinks.append(OverrunReporter(study.call_monitor, run.rate_hz, log, console))
                ahead = None
                if forward is not None and isinstance(log, BatchLog):
                    ahead = forward(rig, run, sequencer, log)
                with settled():
                    loop.run(rig, run, sequencer, clock, console, log, sinks, ahead)
        except (PluginError, DeviceError) as error:
            log.note(Event("session.failed", clock.now(), {"why": str(error)}))
            error.add_note(
                "the data recorded until then are in the participant file; to continue, run: "
                f"{visit.resume_command}"
            )
            raise
        finally:
            log.close()


def _carried(visit: Visit) -> tuple[Response, ...]:
    """Return what the tracks of a new session go on from."""
    folder = visit.folder.path
    journals = [journal_path(folder, number, "run") for number in range(1, visit.session)]
    return carry(visit.study, journals)


def _watching(visit: Visit, rig: Rig) -> AbstractContextManager[None]:
    if visit.fast:
        clear(visit.crash_marker)  # of a process that died, and was read
        return loosely_watched((*rig.components, *rig.tasks.values()))
    return visit.study.call_monitor.published(visit.crash_marker)


@contextmanager
def _scheduled(visit: Visit) -> Iterator[dict[str, Any]]:
    """Schedule the loop as a visit specifies; yield the metadata for the record.

    What real time gains is measured here and now, by a second of an empty loop before and with it.
    """
    if not visit.real_time:
        yield {}
        return
    rate_hz = visit.study.protocol.rate_hz
    before = _late(SystemClock(), rate_hz)
    with real_time(visit.core) as granted:
        with_it = _late(SystemClock(SystemClock.REAL_TIME_SPIN_S), rate_hz)
        lateness = {"before": before, "with": with_it}
        yield {"real_time": {**asdict(granted), "lateness_ms": lateness}}


@contextmanager
def _awake(visit: Visit) -> Iterator[dict[str, Any]]:
    """Keep the screen awake while people are recorded; yield the metadata for the record."""
    if visit.simulated:
        yield {}
        return
    with wake_lock() as lock:
        yield {"wake_lock": asdict(lock)}


def _late(clock: Clock, rate_hz: float) -> dict[str, float]:
    late = 1e3 * lateness(clock, rate_hz, MEASURED_S)
    return {
        "p50": float(np.quantile(late, 0.5)),
        "p99": float(np.quantile(late, 0.99)),
        "most": float(late.max()),
    }


def _log(visit: Visit, run: Run, clock: Clock, reserve: int) -> FrameLog:
    now = clock.now if visit.fast else None
    path, held = next_part(visit.journal), columns(run)
    journal = SessionJournal(path, held, run.rate_hz, now=now)
    return BatchLog(journal, run) if visit.fast else FrameLog(journal, run, reserve)


def _clock(visit: Visit, so_far: Progress | None) -> Clock:
    """Return the session's clock; a simulated one goes on where the last part ended."""
    if not visit.fast:
        return SystemClock(SystemClock.REAL_TIME_SPIN_S if visit.real_time else SystemClock.SPIN_S)
    if so_far is None or so_far.time is None:
        return ManualClock()
    return ManualClock(start=so_far.time + 1.0 / visit.study.protocol.rate_hz)


def policy_of(visit: Visit) -> Policy:
    """Return where a visit goes on: as it says itself, or as the protocol does."""
    return visit.policy or visit.study.protocol.on_fault.session_died


def go_on(visit: Visit, whole: SessionPlan) -> tuple[Progress, SessionPlan]:
    """Return how far a session came that stopped, and what is left of it.

    Raises
    ------
    ProtocolError
        It was never begun, was begun with another plan, or nothing remains.
    """
    so_far = progress(visit.journal, visit.study.machine.names)
    check_recorded(whole, so_far)
    left = remaining(visit.study, whole, so_far, policy_of(visit))
    if left.steps:
        return so_far, left
    if so_far.called_complete and not remaining(visit.study, whole, so_far, "redo_trial").steps:
        raise ProtocolError(
            f"session {visit.session} of {visit.folder.name} is complete, so there is nothing "
            "to continue; labcrane recover writes its participant file"
        )
    if so_far.stop == INCOMPLETE:
        left = remaining(visit.study, whole, so_far, "redo_trial")
        given_up = owed_text(left, TrialCounts.of(whole))
        raise ProtocolError(
            f"nothing remains in session {visit.session} of {visit.folder.name} under policy "
            f"{policy_of(visit)!r}; abandoned: {given_up}; to repeat them, use "
            "--policy redo_trial"
        )
    return so_far, left  # all is done, and only its end is still to be said


@dataclass(frozen=True, slots=True)
class Outlook:
    """Information for the experimenter before a session continues.

    Attributes
    ----------
    text
        How it stopped, and what follows.
    done
        How many counted trials are over for good.
    unjudged
        Trial and attempt of a test that can still be judged; empty for none.
    """

    text: str
    done: int
    unjudged: Mapping[str, Value]


def outlook(visit: Visit, admission: Admission) -> Outlook:
    """Return the information for the experimenter before a session continues.

    Raises
    ------
    ProtocolError
        There is nothing to continue.
    """
    whole = plan_session(visit.study, visit.participant, visit.session, admission.slot)
    so_far, left = go_on(visit, whole)
    counts = TrialCounts.of(whole)
    again = repeats(left, so_far)
    lines = [
        f"session {visit.session} of {visit.folder.name} stopped: {so_far.stop}",
        f"left to do: {owed_text(left, counts) or 'nothing except the end of the session'}",
        f"repeated, as new attempts ({policy_of(visit)}): "
        f"{counts.names(again) if again else 'nothing'}",
    ]
    unjudged = Ledger(visit.study, whole, so_far).unjudged
    if unjudged.get("trial") in again:
        unjudged = {}
    return Outlook("\n".join(lines), done_before(whole, so_far, left), unjudged)


def still_owed(visit: Visit, admission: Admission) -> str:
    """Return what remains of a recorded session, as people count trials; empty for nothing."""
    whole = plan_session(visit.study, visit.participant, visit.session, admission.slot)
    so_far = progress(visit.journal, visit.study.machine.names)
    return owed_text(remaining(visit.study, whole, so_far, "redo_trial"), TrialCounts.of(whole))


def _opening(
    about: Mapping[str, Any], so_far: Progress | None, died: CrashMarker | None, now: float
) -> Iterator[Event]:
    """Yield what is to be known before the first tick."""
    yield Event("session.start", now, about)
    if died is not None:
        yield Event("session.died", now, {"where": str(died), "died_in_tick": died.tick})
    if so_far is not None and so_far.interrupted is not None:
        # The dead process could not close its trial; it is a row like any other.
        lost = {**so_far.interrupted, "outcome": str(Phase.INTERRUPTED)}
        yield Event("trial.end", now, lost)


@contextmanager
def _triggers(
    visit: Visit, run: Run, log: FrameLog, console: Console
) -> Iterator[list[Callable[[Frame], None]]]:
    study = visit.study
    chosen = {
        part.removeprefix(TRIGGERS): choice
        for part, choice in study.choices.items()
        if part.startswith(TRIGGERS)
    }
    if visit.fast or not chosen:  # a simulation is over long before any device has seen a pulse
        yield []
        return
    from labcrane.streams.triggers import Triggers, opened  # noqa: PLC0415

    built = {name: choice.build(study.machine) for name, choice in chosen.items()}
    lines = {name: each for name, each in built.items() if isinstance(each, Trigger)}
    with opened(lines, run):
        triggers = Triggers(lines, log.append, console.report)
        yield [triggers]
        triggers.finish()


def _teller(console: Console) -> Callable[[Frame], None]:
    def tell(frame: Frame) -> None:
        for event in frame.events:
            console.report(event)

    return tell


@contextmanager
def _outlets(
    visit: Visit,
    whole: SessionPlan,
    done: int,
    run: Run,
    offer: Callable[[Mapping[str, str]], None] | None,
) -> Iterator[list[Callable[[Frame], None]]]:
    if visit.fast:  # its timestamps are not the computer's time, so the streams are useless
        yield []
        return
    from labcrane.streams.context import CONTEXT, ContextOutlet  # noqa: PLC0415
    from labcrane.streams.frames import FRAME, FrameOutlet  # noqa: PLC0415
    from labcrane.streams.outlets import Outlets  # noqa: PLC0415 - loads liblsl

    frames = FrameOutlet(run, visit.source)
    about = ContextOutlet(run, visit.source, TrialCounts.of(whole).counted, done)
    outlets = (Outlets(run, visit.source), frames, about)
    if offer:
        offer({FRAME: frames.description, CONTEXT: about.description})
    try:
        yield [outlet.push for outlet in outlets]
    finally:
        for outlet in outlets:
            outlet.close()
