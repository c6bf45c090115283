"""Crash marker: which component a session is in, in a small file that outlives it.

A process that exits or hangs in a plugin cannot say so any more. The session therefore stores one
number before it enters a component and one after: a store into memory that the operating system
keeps, which costs no system call.
"""

import json
import mmap
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from labcrane.errors import RecordingError

SHIFT = 16
"""The number is the tick, counted from 1, times two to this power, plus the place."""

BYTES = 8
"""Of the number, with which the file begins; the places follow as JSON."""


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
    """

    tick: int
    place: Place | None

    def __str__(self) -> str:
        when = "before the first tick" if self.tick < 0 else f"tick {self.tick}"
        return f"{self.place or 'labcrane itself'}, {when}"


class WhereaboutsFile:
    """The file, as the session process writes it.

    Attributes
    ----------
    number
        Its one item is the number.
    """

    def __init__(self, path: Path, places: Sequence[Place]) -> None:
        self._path = path
        try:
            path.write_bytes(bytes(BYTES) + json.dumps([asdict(each) for each in places]).encode())
            with path.open("r+b") as file:
                self._map = mmap.mmap(file.fileno(), BYTES)
        except OSError as error:
            raise RecordingError(f"{path} cannot be written: {error.strerror}") from error
        self.number = memoryview(self._map).cast("q")

    def close(self) -> None:
        """Remove the file: what ended in order needs no explanation."""
        self.number.release()
        self._map.close()
        self._path.unlink(missing_ok=True)


def whereabouts_path(journal: Path) -> Path:
    """Return where the file of a session is: beside its journal."""
    return journal.with_suffix(".where")


def read_number(path: Path) -> int | None:
    """Return the number as it is now; None when there is no file."""
    try:
        with path.open("rb") as file:
            raw = file.read(BYTES)
    except FileNotFoundError:
        return None
    return int.from_bytes(raw, sys.byteorder) if len(raw) == BYTES else None


def read_whereabouts(path: Path) -> CrashMarker | None:
    """Return where a session is, or was when its process died; None when there is no file."""
    number = read_number(path)
    if number is None:
        return None
    places = [Place(**fields) for fields in json.loads(path.read_bytes()[BYTES:])]
    index = number % (1 << SHIFT)
    return CrashMarker((number >> SHIFT) - 1, places[index - 1] if index else None)
