"""Visit of a participant: which session is to be run, of whom, how, and where it is recorded."""

import os
import shlex
import socket
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from hashlib import sha256
from pathlib import Path
from typing import Any

from labcrane.errors import ProtocolError
from labcrane.files.yaml import read_text
from labcrane.protocol.study import Study, load
from labcrane.recording.crash_marker import CrashMarker, crash_marker_path
from labcrane.recording.data_folder import DataFolder
from labcrane.recording.journal import START
from labcrane.recording.journal_reader import read_journal
from labcrane.recording.paths import journal_path, parts
from labcrane.registry.registry import discover
from labcrane.session.resume import INCOMPLETE, Policy, progress


@dataclass(frozen=True, slots=True)
class Visit:
    """One session to be run.

    Attributes
    ----------
    study
        The study, as read from its protocol.
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
    resumed
        Whether the session goes on after its process died.
    policy
        Where it goes on; what the protocol says by default.
    feedback
        Whether the launcher starts the views and sounds, so that the session waits for them.
    real_time
        Whether the loop is scheduled in real time.
    core
        The processor core that is left to it then; None for any.
    died
        Where its process died before, as the launcher read it; None where nothing says so.
    """

    study: Study
    participant: str
    session: int
    data: Path
    simulated: bool = False
    fast: bool = False
    pilot: bool = False
    resumed: bool = False
    policy: Policy | None = None
    feedback: bool = False
    real_time: bool = False
    core: int | None = None
    died: CrashMarker | None = None

    @property
    def folder(self) -> DataFolder:
        """Where it is recorded."""
        return DataFolder(self.data, self.participant, self.pilot, self.simulated)

    @property
    def source(self) -> str:
        """Which session this is, the same whenever it is resumed; its streams are named by it.

        Studies and people of one name meet on a network: the last part is of where it is recorded.
        """
        where = f"{socket.gethostname()}:{self.folder.path.resolve()}"
        session = f"{self.study.protocol.study}/{self.folder.name}/ses-{self.session:02}"
        return f"{session}/{sha256(where.encode()).hexdigest()[:8]}"

    @property
    def journal(self) -> Path:
        """The first part of the session's journal."""
        return journal_path(self.folder.path, self.session, "run")

    @property
    def crash_marker(self) -> Path:
        """The file that says in which component it is, while it runs and after it has died."""
        return crash_marker_path(self.journal)

    @property
    def streams_journal(self) -> Path:
        """The first part of the journal of the streams of others."""
        return journal_path(self.folder.path, self.session, "streams")

    @property
    def resume_command(self) -> str:
        """The command that continues it, with every option that it was run with."""
        words = ["labcrane", "resume", str(self.study.path), "--participant", self.participant]
        words += ["--session", str(self.session)]
        if self.data != self.study.path.parent / "data":
            words += ["--data", str(self.data)]
        words += ["--pilot"] * self.pilot + ["--simulate"] * self.simulated
        words += ["--real-time"] * self.real_time
        return subprocess.list2cmdline(words) if os.name == "nt" else shlex.join(words)

    def __reduce__(self) -> tuple[Any, ...]:
        """Cross to another process by the names of things: the study is loaded again there."""
        rest = {one.name: getattr(self, one.name) for one in fields(self) if one.name != "study"}
        return _again, (self.study.path, self.study.recorded, rest)


def claim(visit: Visit) -> None:
    """Make the participant's folder, and make sure that the session can be recorded in it.

    Raises
    ------
    ProtocolError
        The session has been begun already: nothing is ever overwritten.
    RecordingError
        The folder cannot be written.
    """
    visit.folder.make()
    check_new(visit)


def check_new(visit: Visit) -> None:
    """Make sure that a session has not been begun.

    Raises
    ------
    ProtocolError
        It has, and says how it ended and what can be run instead: nothing is ever overwritten.
    """
    folder = visit.folder
    begun = folder.sessions()
    if visit.session not in begun:
        return
    so_far = progress(visit.journal, visit.study.machine.names)
    if not so_far.called_complete:
        again = " --policy redo_trial" if so_far.stop == INCOMPLETE else ""
        raise ProtocolError(
            f"participant {folder.name} has an unfinished session {visit.session} (in "
            f"{folder.path}): {so_far.stop}; to continue, run: "
            f"{visit.resume_command}{again}"
        )
    sessions = enumerate(visit.study.protocol.sessions, start=1)
    rest = [(number, each.name) for number, each in sessions if number not in begun]
    left = [f"--session {number} ({name!r})" for number, name in rest]
    others = (
        f", or use the next one: {left[0]}"
        if left
        else "; the study has no further session: use another --participant"
    )
    pilot = (
        "; for a pilot session, any other --participant is possible" if visit.pilot and left else ""
    )
    raise ProtocolError(
        f"participant {folder.name} has already completed session {visit.session} (recorded "
        f"in {folder.path}: {', '.join(map(str, begun))}); check the number{others}{pilot}"
    )


def check_begun(visit: Visit) -> None:
    """Make sure that there is a session to be resumed.

    Raises
    ------
    ProtocolError
        It was not begun as it is to be resumed: as a pilot's, a simulation's or a person's.
    """
    if parts(visit.journal):
        return
    visit.study.check_participant(visit.participant)
    others = [
        replace(visit, pilot=pilot, simulated=simulated)
        for simulated in (False, True)
        for pilot in (False, True)
    ]
    if begun := [other for other in others if parts(other.journal)]:
        listed = "; or ".join(
            f"{other.folder.name} has one: run {other.resume_command}" for other in begun
        )
        raise ProtocolError(
            f"{visit.folder.name} has no session {visit.session} to continue, but {listed}"
        )
    progress(visit.journal, ())  # which says that there is none


def visit_of(protocol: Path, participant: str, session: int, data: Path, **options: Any) -> Visit:
    """Return a visit of the study in ``protocol``; ``options`` are the visit's other attributes.

    A session that was begun can be continued with its protocol of then, even if that would be
    refused today: :attr:`Study.outdated` states why.

    Raises
    ------
    ProtocolError
        The protocol is not as it should be.
    """
    registry = discover(study=protocol)
    try:
        study = load(protocol, registry)
    except ProtocolError as error:
        who = {name: options.get(name, False) for name in ("pilot", "simulated")}
        journal = journal_path(DataFolder(data, participant, **who).path, session, "run")
        if not (options.get("resumed") and _was_begun_with(protocol, journal)):
            raise
        study = replace(load(protocol, registry, recorded=True), outdated=str(error))
    return Visit(study, participant, session, data, **options)


def _was_begun_with(protocol: Path, journal: Path) -> bool:
    """Whether a session was begun with a protocol of just this text."""
    log, _ = read_journal(parts(journal))
    begun = [event.data.get("protocol") for event in log.events if event.name == START]
    return read_text(protocol) in begun


def _again(protocol: Path, recorded: bool, rest: Mapping[str, Any]) -> Visit:  # noqa: FBT001
    return Visit(load(protocol, discover(study=protocol), recorded=recorded), **rest)
