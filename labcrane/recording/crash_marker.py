"""Crash marker: which component a session is in, in a small file that outlives it.

A process that exits or hangs in a plugin cannot say so any more. The session therefore stores one
number before it enters a component and one after: a store into memory that the operating system
keeps, which costs no system call.
"""

import json
import mmap
import os
import stat
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path

from labcrane.errors import RecordingError
from labcrane.files.atomic import PRIVATE_FILE, give_name
from labcrane.files.system import BINARY

SHIFT = 16
"""The number is the tick, counted from 1, times two to this power, plus the place."""

BYTES = 8
"""Of the number, with which the file begins; the places follow as JSON."""

MOST_BYTES = 1_000_000
"""Of the whole file; a study with many components takes a hundredth of it."""

LONGEST = 1000
"""Characters of a name or of a source's path."""

_NO_LINK: int = getattr(os, "O_NOFOLLOW", 0)


@dataclass(frozen=True, slots=True)
class Place:
    """A method of a component.

    Attributes
    ----------
    component
        Role and name: ``dynamics 'bullet_crane'``.
    plugin
        What offers it.
    method, source
        Its name, and the file and line where it begins.
    """

    component: str
    plugin: str
    method: str
    source: str

    def __str__(self) -> str:
        return f"{self.component} of plugin {self.plugin!r}, in {self.method}() ({self.source})"


@dataclass(frozen=True, slots=True)
class CrashMarker:
    """Where a session was.

    Attributes
    ----------
    tick
        Number of the tick; -1 before the first.
    place
        The component that had been entered; None for labcrane itself.
    damaged
        The file, where it does not say it any more: it is damaged, or nothing that labcrane wrote.
    """

    tick: int
    place: Place | None
    damaged: Path | None = None

    def __str__(self) -> str:
        if self.damaged is not None:
            return f"an unknown place, because {self.damaged} is damaged"
        when = "before the first tick" if self.tick < 0 else f"tick {self.tick}"
        return f"{self.place or 'labcrane itself'}, {when}"


class CrashMarkerFile:
    """The file, as the session process writes it.

    Attributes
    ----------
    number
        Its one item is the number.
    """

    def __init__(self, path: Path, places: Sequence[Place]) -> None:
        self._path = path
        try:
            clear(path)
            content = bytes(BYTES) + json.dumps([asdict(each) for each in places]).encode()
            flags = os.O_RDWR | os.O_CREAT | os.O_EXCL | BINARY
            with os.fdopen(os.open(path, flags, PRIVATE_FILE), "r+b") as file:
                file.write(content)
                file.flush()
                self._map = mmap.mmap(file.fileno(), BYTES)
        except OSError as error:
            raise RecordingError(f"{path} cannot be written: {error.strerror}") from error
        self.number = memoryview(self._map).cast("q")

    def close(self) -> None:
        """Remove the file: what ended in order needs no explanation."""
        self.number.release()
        self._map.close()
        self._path.unlink(missing_ok=True)


def take_crash_marker(path: Path) -> CrashMarker | None:
    """Return where a session's process died, and remove the file; None when there is none.

    Raises
    ------
    RecordingError
        It cannot be removed.
    """
    found = read_crash_marker(path)
    try:
        clear(path)
    except OSError as error:
        raise RecordingError(f"{path} cannot be removed: {error.strerror}") from error
    return found


def clear(path: Path) -> None:
    """Make room for the file of a session: of a process that died, and was read.

    A link is removed, never its target; a folder, which labcrane never writes, is moved aside.
    """
    if path.is_dir() and not path.is_symlink():
        give_name(path, path.with_name(f"{path.name}.{os.getpid()}.aside"))
    else:
        path.unlink(missing_ok=True)


def crash_marker_path(journal: Path) -> Path:
    """Return the path of a session's file, next to its journal."""
    return journal.with_suffix(".where")


def read_number(path: Path) -> int | None:
    """Return the number as it is now; None when there is no file that has one."""
    raw = _read(path, BYTES)
    return int.from_bytes(raw, sys.byteorder) if raw is not None and len(raw) == BYTES else None


def read_crash_marker(path: Path) -> CrashMarker | None:
    """Return where a session is, or was when its process died; None when there is no file.

    It explains an end, and nothing depends on it. A file that a power loss or another program has
    damaged is reported as damaged.
    """
    if not os.path.lexists(path):
        return None
    raw = _read(path, MOST_BYTES + 1)
    if raw is None or not BYTES <= len(raw) <= MOST_BYTES:
        return CrashMarker(-1, None, path)
    number = int.from_bytes(raw[:BYTES], sys.byteorder)
    index, tick = number % (1 << SHIFT), (number >> SHIFT) - 1
    try:
        written = json.loads(raw[BYTES:])
        places = [_place(each) for each in written]
        place = places[index - 1] if index else None
    except (LookupError, RecursionError, TypeError, ValueError):
        return CrashMarker(-1, None, path)
    if number >> (8 * BYTES - 1):  # a negative one, which no session stores
        return CrashMarker(-1, None, path)
    return CrashMarker(tick, place)


def _place(written: object) -> Place:
    """Return a place as a session wrote it; what is printed moves no terminal's cursor."""
    names = {each.name for each in fields(Place)}
    if not (isinstance(written, dict) and written.keys() == names):
        raise TypeError("a place has names for what it is made of, and no others")
    for value in written.values():
        if not (isinstance(value, str) and len(value) <= LONGEST and value.isprintable()):
            raise TypeError("a place is made of short texts")
    return Place(**written)


def _read(path: Path, most: int) -> bytes | None:
    """Return the first bytes of a plain file; None of anything else, which may never end."""
    try:
        if not stat.S_ISREG(path.lstat().st_mode):
            return None
        with os.fdopen(os.open(path, os.O_RDONLY | BINARY | _NO_LINK), "rb") as file:
            return file.read(most)
    except OSError:
        return None
