"""Recovery of participant files from whatever journals a crash left."""

from dataclasses import dataclass
from pathlib import Path

from labcrane.errors import RecordingError
from labcrane.recording.crash_marker import crash_marker_path, read_crash_marker
from labcrane.recording.participant_file.backlog import journals_of, sizes_in, sizes_on_disk
from labcrane.recording.participant_file.writer import (
    Conclude,
    Consolidated,
    consolidate,
    reading,
)
from labcrane.recording.paths import journal_path, participant_path, session_of


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
