"""Run one session: open the rig, lead it through its plan, leave a participant file."""

import hashlib
import platform
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from labcrane import loop, rig
from labcrane.attempt import trial_units
from labcrane.clock import Clock, ManualClock, SystemClock
from labcrane.console import Console
from labcrane.course import Course
from labcrane.data_folder import DataFolder
from labcrane.frame_log import FrameLog, columns
from labcrane.plan import SessionPlan, plan_session
from labcrane.recording.journal import SessionJournal
from labcrane.recording.participant_file import consolidate
from labcrane.records import Event, Frame, Run
from labcrane.rig import Rig
from labcrane.study import Choice, Study

RECORDED_PACKAGES = ("labcrane", "numpy", "pybullet", "pygame", "pylsl", "pydantic")


@dataclass(frozen=True, slots=True)
class Visit:
    """One session to be run.

    Attributes
    ----------
    participant, session
        Who, and which of the protocol's sessions, counted from 1.
    data
        The study's data folder.
    simulated
        Whether a simulated operator takes the controls.
    fast
        Whether to run as fast as the machine can, without LSL; for simulations only.
    pilot
        Whether this is a trial run, to be stamped as one.
    """

    study: Study
    participant: str
    session: int
    data: Path
    simulated: bool = False
    fast: bool = False
    pilot: bool = False

    @property
    def folder(self) -> DataFolder:
        """Where it is recorded."""
        return DataFolder(self.data, self.participant, self.pilot, self.simulated)


def run(visit: Visit, console: Console) -> Path:
    """Run a session to its end; return the participant file.

    Whatever ends it, what was recorded until then is in the file.

    Raises
    ------
    ProtocolError, DeviceError, RecordingError
        Before anything is recorded: the session cannot be run.
    """
    study, folder = visit.study, visit.folder
    plan = plan_session(study, visit.participant, visit.session)
    folder.claim(visit.session)
    the_rig = rig.build(study, simulated=visit.simulated)
    clock: Clock = ManualClock() if visit.fast else SystemClock()
    with rig.opened(the_rig, study, plan.seed) as this_run:
        course = Course(study, plan, the_rig, waits=not visit.simulated)
        begin = Event("session.start", clock.now(), context(visit, plan, the_rig, this_run))
        journal = SessionJournal(folder.journal(visit.session), columns(this_run), this_run.rate_hz)
        try:
            log = FrameLog(journal, this_run)
            log.note(begin)
            with _outlets(visit, this_run) as outlets:
                sinks = (log.write, *outlets, _teller(console))
                loop.run(the_rig, this_run, course, clock, console, sinks)
        finally:
            journal.close()
            consolidate(folder.participant_file, [folder.journal(visit.session)])
    return folder.participant_file


def _teller(console: Console) -> Callable[[Frame], None]:
    def tell(frame: Frame) -> None:
        for event in frame.events:
            console.report(event)

    return tell


@contextmanager
def _outlets(visit: Visit, this_run: Run) -> Iterator[list[Callable[[Frame], None]]]:
    if visit.fast:  # its stamps are not the computer's time, so nobody could use the streams
        yield []
        return
    from labcrane.streams.outlets import Outlets  # noqa: PLC0415 - loads liblsl

    source = f"{visit.study.protocol.study}/{visit.folder.name}/ses-{visit.session:02}"
    outlets = Outlets(this_run, source)
    try:
        yield [outlets.push]
    finally:
        outlets.close()


def context(visit: Visit, plan: SessionPlan, the_rig: Rig, this_run: Run) -> dict[str, Any]:
    """Return everything that whoever reads the recording must know, ready for JSON."""
    study = visit.study
    choices = {
        "input": study.operator if visit.simulated else study.input,
        "scheme": study.scheme,
        "dynamics": study.dynamics,
        **{f"tasks.{name}": choice for name, choice in study.task_choices.items()},
    }
    return {
        "study": study.protocol.study,
        "title": study.protocol.title,
        "participant": visit.folder.name,
        "session": visit.session,
        "session_name": plan.name,
        "started": datetime.now(UTC).isoformat(timespec="milliseconds"),
        "simulated": visit.simulated,
        "fast": visit.fast,
        "pilot": visit.pilot,
        "clock": "manual" if visit.fast else "lsl",
        "rate_hz": this_run.rate_hz,
        "seed": plan.seed,
        "protocol": study.text,
        "protocol_sha256": study.sha256,
        "machine": study.machine_text,
        "machine_sha256": hashlib.sha256(study.machine_text.encode()).hexdigest(),
        "components": {part: _choice(choice) for part, choice in choices.items()},
        "facts": the_rig.facts(),
        "versions": _versions(),
        "plan": [
            {"block": block.number, "name": block.name, "trials": len(block.trials)}
            for block in plan.blocks
        ],
        "trial_units": {
            column: unit
            for task in study.tasks.values()
            for column, unit in trial_units(task).items()
        },
    }


def _choice(choice: Choice) -> dict[str, Any]:
    return {
        "use": choice.name,
        "plugin": choice.plugin,
        "settings": choice.settings.model_dump(mode="json"),
    }


def _versions() -> dict[str, str]:
    return {
        "python": platform.python_version(),
        "system": platform.platform(),
        **{name: version(name) for name in RECORDED_PACKAGES if find_spec(name)},
    }
