"""Backlog of a participant file: what journals beside it hold that is not in it yet."""

from pathlib import Path
from typing import TYPE_CHECKING

from labcrane.recording.participant_file.columns import texts_of
from labcrane.recording.participant_file.writer import group_name, reading
from labcrane.recording.paths import journal_path, parts, session_of

if TYPE_CHECKING:
    import h5py


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
