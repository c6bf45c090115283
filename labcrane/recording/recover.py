"""Makes participant files of whatever journals a crash left."""

from dataclasses import dataclass
from pathlib import Path

from labcrane.errors import RecordingError
from labcrane.recording.foreign_streams import Conclude
from labcrane.recording.hdf5_columns import texts_of
from labcrane.recording.participant_file import Consolidated, consolidate, group_name, opened
from labcrane.recording.parts import journal_path, parts, session_of
from labcrane.whereabouts import read_whereabouts, whereabouts_path


@dataclass(frozen=True, slots=True)
class Recovery:
    """What became of one session's journals.

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
    path = folder / f"{folder.resolve().name}.h5"
    firsts = [journal_path(folder, session, kind) for kind in ("run", "streams")]
    journals = [first for first in firsts if parts(first)]
    where = str(read_whereabouts(whereabouts_path(firsts[0])) or "")
    try:
        if _is_current(path, session, journals):
            return Recovery(path, session, where=where)
        return Recovery(path, session, consolidate(path, journals, conclude), where=where)
    except RecordingError as error:
        return Recovery(path, session, problem=str(error))


def _is_current(path: Path, session: int, journals: list[Path]) -> bool:
    """Return whether the session was made of exactly these journals."""
    if not path.exists():
        return False
    on_disk = {part.name: part.stat().st_size for first in journals for part in parts(first)}
    with opened(path) as file:
        if group_name(session) not in file:
            return False
        made_of = file[f"{group_name(session)}/journals"]
        return on_disk == dict(
            zip(texts_of(made_of["name"]), made_of["size"][:].astype(int), strict=True)
        )
