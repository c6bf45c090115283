"""Annotations: notes that people add to a recording afterwards, in a file of their own next to it.

``ses-01_annotations.jsonl`` is in the participant's folder. It is erased, transferred and
relabelled with the recordings, and stays when the participant file is rebuilt from its journals.
The recording itself is never changed. No line is ever removed from the file: withdrawing an
annotation adds a line that says so.

A group in the participant file would be lost when the file is made again.
"""

import json
import math
import os
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from labcrane.errors import RecordingError
from labcrane.files.atomic import write_text
from labcrane.files.lock import held
from labcrane.limits import LIMITS, LimitError, check_text

PATIENCE_S = 5.0
"""How long an annotation waits while another one is written, in seconds."""

COLUMNS = ("time", "until", "text", "written", "coder")
"""Columns of every annotation: two times in seconds, and three texts."""


@dataclass(frozen=True, slots=True)
class Annotation:
    """A mark.

    Attributes
    ----------
    time
        Its time, or its beginning, in seconds on the session's clock.
    until
        When it ends, in seconds on the same clock; the same as ``time`` for a moment.
    text
        What it says.
    written
        When it was made, by the computer's calendar: ``2026-03-05T14:07:31+01:00``.
    number
        Which line of the file it is, from 1.
    coder
        Who made it, by the coder's own abbreviation; empty where it was not given.
    """

    time: float
    until: float
    text: str
    written: str
    number: int
    coder: str = ""


def annotations_path(folder: Path, session: int) -> Path:
    """Return where the marks of a session are, in the participant's folder."""
    return folder / f"ses-{session:02d}_annotations.jsonl"


def is_annotations(path: Path) -> bool:
    """Whether a file has the name of one with marks."""
    return path.name.startswith("ses-") and path.name.endswith("_annotations.jsonl")


def read_annotations(folder: Path, session: int) -> list[Annotation]:
    """Return the marks of a session that hold, in the order of their times.

    Raises
    ------
    RecordingError
        The file cannot be read, or one of its lines is not an annotation.
    """
    path = annotations_path(folder, session)
    marks: dict[int, Annotation] = {}
    for number, line in enumerate(_lines(path), start=1):
        try:
            said = mapping_in(line)
            if "withdraws" in said:
                del marks[int(said["withdraws"])]
            else:
                marks[number] = _annotation(said, number)
        except (ValueError, TypeError, LookupError) as error:
            raise RecordingError(
                f"{path}, line {number} is not an annotation: {error!r}; correct it, and leave all "
                "lines in their places: annotations are known by their line numbers"
            ) from error
    return sorted(marks.values(), key=lambda mark: (mark.time, mark.number))


def annotate(
    recording: Path,
    session: int,
    time: float,
    text: str,
    until: float | None = None,
    coder: str = "",
) -> Annotation:
    """Add a mark to a session.

    Parameters
    ----------
    recording
        The participant file, in its place in the data folder; it is not opened.
    time, until
        From when to when, in seconds on the session's clock; a moment without ``until``.
    coder
        Who makes it.

    Raises
    ------
    RecordingError
        It cannot be written there, or is not valid; the file is then unchanged.
    """
    if not text.strip():
        raise RecordingError("an annotation cannot be empty; describe what it marks")
    try:
        check_text(text, "note")
        check_text(coder, "note")
    except LimitError as error:
        raise RecordingError(f"an annotation is a note, and {error}") from error
    end = time if until is None else until
    if not (math.isfinite(time) and math.isfinite(end) and end >= time):
        raise RecordingError(
            f"an annotation cannot last from {time:g} to {end:g} s; give a time, and an end that "
            "is not before it"
        )
    said = {"time": time, "until": end, "text": text.strip(), "written": _now()}
    said |= {"coder": coder.strip()} if coder.strip() else {}
    number = _append(recording, session, said)
    return _annotation(said, number)


def withdraw(recording: Path, session: int, number: int) -> None:
    """Take back the mark of a number; the file keeps it, and says that it was taken back.

    Raises
    ------
    RecordingError
        There is none, or it cannot be written.
    """
    _append(recording, session, {"withdraws": number, "written": _now()})


def _append(recording: Path, session: int, said: dict[str, Any]) -> int:
    """Rewrite the file with one more line, and return its number."""
    folder = _own_folder(recording)
    path = annotations_path(folder, session)
    lock = folder / f".{path.stem}.lock"
    try:
        with held(lock, f"another annotation in {folder} is being saved; try again", PATIENCE_S):
            there = read_annotations(folder, session)  # a file with a fault is not added to
            known = [mark.number for mark in there]
            if "withdraws" in said and said["withdraws"] not in known:
                raise RecordingError(
                    f"{path} has no annotation {said['withdraws']}; it has "
                    + (", ".join(map(str, sorted(known))) or "none")
                )
            lines = [*_lines(path), json.dumps(said, ensure_ascii=False)]
            write_text(path, "".join(f"{line}\n" for line in lines))
    except OSError as error:
        raise RecordingError(
            f"cannot write {path}: {error.strerror}; the recording is unchanged: work on your own "
            "copy, or ask the administrator of the data"
        ) from error
    return len(lines)


def _own_folder(recording: Path) -> Path:
    """Return the folder that marks go to, which is erased and relabelled with the recording."""
    folder = recording.absolute().parent
    if recording.stem != folder.name or not folder.is_dir():
        raise RecordingError(
            f"{recording} is not in its place, {recording.stem}/{recording.name} in a data folder, "
            "so erasing the participant would miss its annotations; add them there"
        )
    if folder.is_symlink():
        raise RecordingError(
            f"{folder} is a link, and erasing never follows links; add the annotations in the "
            "folder itself"
        )
    status = folder.stat()
    if sys.platform != "win32" and status.st_uid != os.geteuid():
        raise RecordingError(
            f"{folder} belongs to another user ({status.st_uid}), who could not change what you "
            "write there; add the annotations as that user"
        )
    if not os.access(folder, os.W_OK | os.X_OK):
        raise RecordingError(
            f"{folder} is read-only, so annotations cannot be saved there; ask the administrator "
            "of the data for write access"
        )
    return folder


def _lines(path: Path) -> Iterator[str]:
    """Yield the lines of a file, none where there is no file."""
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        return
    except (OSError, UnicodeDecodeError) as error:
        raise RecordingError(f"cannot read {path}: {error}; nothing was changed") from error
    yield from text.removesuffix("\n").split("\n") if text else ()


def mapping_in(line: str) -> dict[str, Any]:
    """Return the mapping that a JSON text holds."""
    said = json.loads(line)
    if not isinstance(said, dict):
        raise TypeError(f"{line[:40]!r} is not a mapping of names")
    return said


def _annotation(said: dict[str, Any], number: int) -> Annotation:
    time, until = float(said["time"]), float(said["until"])
    text, written = str(said["text"]), str(said["written"])
    if not (math.isfinite(time) and math.isfinite(until)) or len(text) > LIMITS["note"].most:
        raise ValueError(f"a time of {time} to {until} s, with {len(text)} characters")
    return Annotation(time, until, text, written, number, str(said.get("coder", "")))


def _now() -> str:
    return datetime.now().astimezone().isoformat(timespec="seconds")
