"""Writer of the participant file, from journals.

HDF5 is never open for writing while people are recorded. Each session is added to a new file next
to the old one. The new file is flushed to the disk, read again, and only then takes the old one's
name.
"""

import errno
import os
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from labcrane.errors import RecordingError, StorageError
from labcrane.files.atomic import replacing
from labcrane.files.lock import alone_in
from labcrane.recording.foreign_streams import RecordedStream, read_streams
from labcrane.recording.journal_reader import JournalState, SessionLog, read_journal
from labcrane.recording.participant_file.about import ABOUT, write_about
from labcrane.recording.participant_file.columns import write_attributes
from labcrane.recording.participant_file.containment import check_containment, check_texts, unpacked
from labcrane.recording.participant_file.seal import seal
from labcrane.recording.participant_file.session_group import write_session
from labcrane.recording.participant_file.signal_faults import write_signal_faults
from labcrane.recording.participant_file.stream_group import write_streams
from labcrane.recording.participant_file.verification import (
    bring_to_disk,
    unlike,
    unlike_journals,
)
from labcrane.recording.paths import parts, session_of

if TYPE_CHECKING:
    import h5py

FORMAT = "labcrane participant file"
VERSION = "1"

_HELD: ContextVar[tuple[Path, "h5py.File"] | None] = ContextVar("held", default=None)
"""The participant file that is kept open."""

Conclude = Callable[["h5py.Group"], object]
"""Computes results from a session's group in a participant file, and writes them there."""

DAMAGED = (
    OSError, RuntimeError, LookupError, ValueError, TypeError, AttributeError, ArithmeticError,
)  # fmt: skip
"""Exceptions that reading a damaged file may raise."""

HELD = frozenset({errno.EACCES, errno.EAGAIN, errno.EBUSY, errno.EMFILE, errno.ENFILE, errno.EPERM})
"""Numbers of errors with which a system refuses a file whatever is in it."""


@dataclass(frozen=True, slots=True)
class Consolidated:
    """Summary of a session that was put into a participant file.

    Attributes
    ----------
    path, session
        Which file, and which session.
    frames, events
        How many.
    streams
        Samples per external stream.
    notes
        Damage of the journals, for people.
    """

    path: Path
    session: int
    frames: int
    events: int
    streams: dict[str, int]
    notes: list[str]


@dataclass
class _Session:
    """Everything that goes into one session's group."""

    number: int
    log: SessionLog
    streams: list[RecordedStream]
    journals: list[JournalState]

    @property
    def group(self) -> str:
        return group_name(self.number)


def group_name(session: int) -> str:
    """Return the name of a session's group."""
    return f"ses-{session:02d}"


def consolidate(
    path: Path, journals: Sequence[Path], conclude: Conclude | None = None
) -> Consolidated:
    """Put one session into a participant file, new or existing.

    May be killed and repeated at any moment: there is always either the file as it was, or the file
    with the session in it. Journals are only read.

    Parameters
    ----------
    path
        The participant file.
    journals
        First segments of the session's journals; further segments next to them are found.
    conclude
        Corrects the timestamps of other clocks and makes the sync report, from what the group
        contains; without it, streams contain raw timestamps only.

    Raises
    ------
    RecordingError
        A file cannot be read or written, or the participant file holds more of the session than
        its journals do. The participant file is as it was.
    """
    session = _read(path, journals)
    with renewed(path, f"labcrane recover {path.parent}") as beside:
        _write(beside, path, session, conclude)
        _verify(beside, path, session)
    return Consolidated(
        path,
        session.number,
        len(session.log.time),
        len(session.log.events),
        {stream.header.name: len(stream.time_raw) for stream in session.streams},
        [note for journal in session.journals for note in journal.notes],
    )


@contextmanager
def renewed(path: Path, again: str) -> Iterator[Path]:
    """Give a new file next to a participant file; it replaces that file when it is complete.

    Waits while another process renews one in the same folder. May be killed at any moment.

    Parameters
    ----------
    again
        The command that makes up for it when it cannot be written.

    Raises
    ------
    RecordingError
        It cannot be written; the participant file is as it was.
    """
    with alone_in(path.parent), replacing(path) as beside:
        try:
            yield beside
            put_seal(beside)
        except DAMAGED as error:  # h5py's, and of an old file that is damaged
            raise RecordingError(
                f"cannot write {path}: {_reason(error)}; it is as it was, and so are the journals: "
                f"remove the cause and run {again}"
            ) from error


def _reason(error: Exception) -> str:
    """Return why HDF5 failed, in the system's words if there are any in its own."""
    if isinstance(error, KeyError):
        return f"an event, or the old file, has no {error}, which it should have"
    found = re.search(r"error message = '([^']+)'", str(error))
    return found[1] if found else str(error)


def _read(path: Path, journals: Sequence[Path]) -> _Session:
    kinds: dict[str, list[Path]] = {"run": [], "streams": []}
    sessions = set()
    for journal in journals:
        named = session_of(journal)
        found = parts(journal)
        if named is None or not found:
            raise RecordingError(
                f"there is no journal {journal}; journals of {path} are called ses-01_run.xdf "
                "and ses-01_streams.xdf"
            )
        sessions.add(named[0])
        kinds[named[1]] += found
    if len(sessions) != 1:
        raise RecordingError(
            f"journals of sessions {sorted(sessions)} were given; give those of one session"
        )
    log, states = read_journal(kinds["run"])
    streams, more_states = read_streams(kinds["streams"])
    return _Session(sessions.pop(), log, streams, states + more_states)


def _write(beside: Path, path: Path, session: _Session, conclude: Conclude | None) -> None:
    import h5py  # noqa: PLC0415 - loads for a second

    context = session.log.context
    with h5py.File(beside, "w") as new:
        if path.exists():
            with opened(path) as old:
                _refuse_less(path, old, session)
                for name in old:
                    if name != session.group and name not in ABOUT:
                        old.copy(name, new)
                about = dict(old.attrs)
        else:
            about = {
                "format": FORMAT,
                "format_version": VERSION,
                "participant": context.get("participant", path.stem),
                "study": context.get("study", ""),
            }
        write_attributes(new, about)
        group = new.create_group(session.group)
        write_attributes(group, {"session": session.number, "participant": path.stem})
        write_session(group, session.log, session.journals)
        write_streams(group, session.streams)
        write_signal_faults(group, session.log, session.streams)
        if conclude is not None:
            conclude(group)
        write_about(new, context)


def put_seal(path: Path) -> None:
    """Seal a participant file that is written, so that later damage is found.

    A program that changes a copy with HDF5 removes its seal, and calls this when it is finished.
    """
    import h5py  # noqa: PLC0415

    with h5py.File(path, "r") as file:
        spans = unpacked(file, path.stat().st_size)
    seal(path, spans)


@contextmanager
def opened(path: Path, *, cached: bool = True) -> Iterator["h5py.File"]:
    """Open a participant file for reading.

    Parameters
    ----------
    cached
        Whether chunks are cached, a megabyte for each column: for reading parts of chunks.

    Raises
    ------
    RecordingError
        It cannot be read, or is not a participant file.
    """
    import h5py  # noqa: PLC0415

    try:
        file = h5py.File(path, "r") if cached else h5py.File(path, "r", rdcc_nbytes=0)
    except (OSError, RuntimeError, ValueError) as error:  # ValueError: no name of a file
        _raise_if_held(path, error)
        raise RecordingError(f"cannot read {path}: {error}") from error
    with file:
        check_texts(file, path)
        if file.attrs.get("format") != FORMAT:
            raise RecordingError(
                f"{path} is an HDF5 file, but not a participant file of labcrane; give the .h5 "
                "file in a participant's folder"
            )
        if file.attrs["format_version"] != VERSION:
            raise RecordingError(
                f"{path} has format version {file.attrs['format_version']!r}, this labcrane reads "
                f"{VERSION!r}; install a newer labcrane"
            )
        check_containment(file, path)
        yield file


@contextmanager
def reading(path: Path, *, cached: bool = True) -> Iterator["h5py.File"]:
    """Open a participant file read-only; damage is reported with a remedy.

    ``cached`` is as for :func:`opened`.

    Raises
    ------
    RecordingError
        It cannot be read, is not a participant file, or is damaged where it was read.
    """
    kept = _HELD.get()
    try:
        if kept is not None and kept[0] == path and cached:
            yield kept[1]
            return
        with opened(path, cached=cached) as file:
            yield file
    # h5py, numpy, pandas and json raise what they like of damaged files.
    except (*DAMAGED, MemoryError) as error:
        _raise_if_held(path, error)
        raise RecordingError(
            f"{path} is damaged: {error!r}; move it elsewhere, then run labcrane recover "
            f"{path.parent} to rebuild it from the journals, if they exist"
        ) from error


def _raise_if_held(path: Path, error: Exception) -> None:
    """Raise that another program or the system refuses a file, where nothing says it is damaged."""
    if isinstance(error, OSError) and error.errno in HELD:
        raise StorageError(
            f"{path} cannot be opened now: {os.strerror(error.errno)}; close the program that "
            "holds it, such as a viewer of HDF5 files, or see who may read it"
        ) from error


@contextmanager
def kept_open(path: Path) -> Iterator[None]:
    """Read a participant file, while the block lasts, from one opening of it.

    Each opening looks through the whole file for links out of it, which takes longer than most of
    what is read then.

    Raises
    ------
    RecordingError
        It cannot be read, or is not a participant file.
    """
    with opened(path) as file, held(path, file):
        yield


@contextmanager
def held(path: Path, file: "h5py.File") -> Iterator[None]:
    """Read a participant file, while the block lasts, from an opening, perhaps for writing."""
    before = _HELD.set((path, file))
    try:
        yield
    finally:
        _HELD.reset(before)


def _refuse_less(path: Path, old: "h5py.File", session: _Session) -> None:
    """Refuse to replace a session by one with fewer samples: its journals are no longer whole."""
    if session.group not in old:
        return
    held = float(old[f"{session.group}/journals/samples"][:].sum())
    given = sum(journal.samples for journal in session.journals)
    if given < held:
        raise RecordingError(
            f"{path} holds {held:.0f} samples of session {session.number}, its journals only "
            f"{given}; the file is unchanged; look for the missing segments of the journals"
        )


def _verify(beside: Path, path: Path, session: _Session) -> None:
    """Read the new file again, and compare all of it with the journals and with the old file."""
    bring_to_disk(beside)
    with opened(beside) as new:
        group = new[session.group]
        wrong = unlike_journals(group, session.log, session.streams, session.journals)
        for name in wrong:
            raise RecordingError(
                f"{session.group}/{name} of {beside} is not what the journals hold; "
                f"{path} is unchanged: check the disk"
            )
        if path.exists():
            written = {session.group, *ABOUT}
            with opened(path) as old:
                check_copied(new, old, lambda name: re.split("[/@]", name)[0] in written)


def check_copied(new: "h5py.File", old: "h5py.File", leave: Callable[[str], bool]) -> None:
    """Compare what was copied with the file that is to be replaced.

    Parameters
    ----------
    leave
        Which groups and columns of the new file are others, by their names; and attributes, as
        ``group@name``.

    Raises
    ------
    RecordingError
        Something of the old file would be lost, or changed.
    """
    for name in unlike(old, new, leave):
        raise RecordingError(
            f"{name or 'its attributes'} of {old.filename} was not copied unchanged; the file "
            "itself is unchanged: check the disk"
        )
