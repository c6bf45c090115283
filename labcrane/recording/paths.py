"""Names of journals, and of the participant file made of them.

A session's journals are ``ses-01_run.xdf`` (frames and events) and ``ses-01_streams.xdf`` (the
streams of others). A process never appends to a file of another one: after a crash the next
process opens ``ses-01_run.part2.xdf``, and so on.
"""

import itertools
import re
from pathlib import Path

from labcrane.errors import RecordingError

_NAME = re.compile(r"(?P<stem>.+?)(?:\.part(?P<number>[0-9]+))?\.xdf")
_JOURNAL = re.compile(r"ses-(?P<session>[0-9]+)_(?P<kind>run|streams)")


def journal_path(folder: Path, session: int, kind: str) -> Path:
    """Return the path of the first part of a session's journal; ``kind`` is run or streams."""
    return folder / f"ses-{session:02d}_{kind}.xdf"


def captured_file(journal: Path, name: str, number: int, suffix: str) -> Path:
    """Return a file of a camera, microphone or screen: ``ses-01_face.mkv``, ``ses-01_face.2.mkv``.

    ``journal`` is the first part of the session's journal; files are counted from 1.
    """
    session = journal.name.partition("_")[0]
    part = "" if number == 1 else f".{number}"
    return journal.with_name(f"{session}_{name}{part}{suffix}")


def participant_path(folder: Path) -> Path:
    """Return the path of the participant file in a participant's folder, whose name it has."""
    return folder / f"{folder.absolute().name}.h5"


def nearby_file(path: Path) -> Path | None:
    """Return the participant file that is meant by ``P001.h5`` where it is ``P001/P001.h5``."""
    folders = (path.parent, path.parent / "data")
    places = (participant_path(folder / path.stem) for folder in folders)
    return next((place for place in places if place.name == path.name and place.is_file()), None)


def part_path(path: Path, number: int) -> Path:
    """Return the path of a part, counted from 1, of the journal whose first part is ``path``."""
    return path if number == 1 else path.with_name(f"{path.stem}.part{number}.xdf")


def part_number(path: Path) -> int:
    """Return which part a journal is, counted from 1."""
    found = _NAME.fullmatch(path.name)
    if found is None:
        raise RecordingError(
            f"{path} is not named like a journal; give it a name such as ses-01_run.part2.xdf"
        )
    return int(found["number"] or 1)


def next_part(path: Path) -> Path:
    """Return the first part of a journal that does not exist yet."""
    return next(
        part
        for part in (part_path(path, number) for number in itertools.count(1))
        if not part.exists()
    )


def parts(path: Path) -> list[Path]:
    """Return all parts of a journal that exist, in order."""
    found = [path, *path.parent.glob(f"{path.stem}.part*.xdf")]
    return sorted((part for part in found if part.is_file()), key=part_number)


def session_of(path: Path) -> tuple[int, str] | None:
    """Return the session and the kind of a journal; None when a file is not a journal."""
    named = _NAME.fullmatch(path.name)
    found = _JOURNAL.fullmatch(named["stem"]) if named else None
    return (int(found["session"]), found["kind"]) if found else None
