"""Recovery of participant files from whatever journals a crash left."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from labcrane.errors import RecordingError
from labcrane.recording.crash_marker import crash_marker_path, read_crash_marker
from labcrane.recording.participant_file.columns import texts_of
from labcrane.recording.participant_file.writer import (
    Conclude,
    Consolidated,
    consolidate,
    group_name,
    reading,
)
from labcrane.recording.paths import journal_path, participant_path, parts, session_of

if TYPE_CHECKING:
    import h5py


@dataclass(frozen=True, slots=True)
class Recovery:
    """Result of recovering one session's journals.

    Attributes
    ----------
    path, session
        The participant file, and which session.
    done
        What was put into it; None when it was in it already, or could not be.
    problem
        Why it could not be; empty otherwise.
    where
        In which component the session's process died; empty when it did not, or is not known.
    """

    path: Path
    session: int
    done: Consolidated | None = None
    problem: str = ""
    where: str = ""


def recover(folder: Path, conclude: Conclude | None = None) -> list[Recovery]:
    """Consolidate every session below ``folder`` whose journals say more than its participant file.

    A participant's file has the name of the folder with the journals. May be killed and repeated
    at any moment; one session that cannot be recovered does not keep the others from it.

    Raises
    ------
    RecordingError
        There is no such folder.
    """
    if not folder.is_dir():
        raise RecordingError(f"there is no folder {folder}; give the study's data folder")
    found = {
        (path.parent, named[0])
        for path in folder.rglob("ses-*.xdf")
        if (named := session_of(path)) is not None
    }
    return [_recover(at, session, conclude) for at, session in sorted(found)]


def _recover(folder: Path, session: int, conclude: Conclude | None) -> Recovery:
    path, journals = participant_path(folder), journals_of(folder, session)
    where = str(read_crash_marker(crash_marker_path(journal_path(folder, session, "run"))) or "")
    try:
        if is_recovered(folder, session):
            return Recovery(path, session, where=where)
        return Recovery(path, session, consolidate(path, journals, conclude), where=where)
    except RecordingError as error:
        return Recovery(path, session, problem=str(error), where=where)


def is_recovered(folder: Path, session: int) -> bool:
    """Return whether the participant file holds a session made of exactly the journals there are.

    Raises
    ------
    RecordingError
        The participant file cannot be read.
    """
    path = participant_path(folder)
    if not path.exists():
        return False
    with reading(path) as file:
        return sizes_in(file, session) == sizes_on_disk(folder, session)


def journals_of(folder: Path, session: int) -> list[Path]:
    """Return the first segments of a session's journals that there are."""
    firsts = (journal_path(folder, session, kind) for kind in ("run", "streams"))
    return [first for first in firsts if parts(first)]


def sizes_on_disk(folder: Path, session: int) -> dict[str, int]:
    """Return the bytes of a session's journals, segment by segment, by name."""
    firsts = journals_of(folder, session)
    return {part.name: part.stat().st_size for first in firsts for part in parts(first)}


def sizes_in(file: "h5py.File", session: int) -> dict[str, int] | None:
    """Return the bytes of the journals of which a session was made; None if it is not there."""
    if group_name(session) not in file:
        return None
    made_of = file[f"{group_name(session)}/journals"]
    return dict(zip(texts_of(made_of["name"]), made_of["size"][:].astype(int), strict=True))


def backlog(path: Path) -> dict[int, str]:
    """Return the sessions of which the journals hold more than a participant file, and the remedy.

    Journals that are shorter, or elsewhere, take nothing from what the file has.

    Raises
    ------
    RecordingError
        The participant file cannot be read.
    """
    named = filter(None, map(session_of, path.parent.glob("ses-*.xdf")))
    sessions = sorted({session for session, _ in named})
    if not sessions:
        return {}
    remedy = (
        "which is older than the journals beside it; the session is still running, or was killed: "
        f"run labcrane recover {path.parent}"
    )
    found = {}
    with reading(path) as file:
        for session in sessions:
            held, there = sizes_in(file, session), sizes_on_disk(path.parent, session)
            if held is None:
                found[session] = f"session {session} is not in {path}, {remedy}"
            elif any(size > held.get(name, 0) for name, size in there.items()):
                found[session] = f"session {session} is only in part in {path}, {remedy}"
    return found
