"""Bytes of a file, of which a window is in memory: an hour's takes no more than a minute's.

Read by ordinary calls, not mapped: a page of a map that the disk cannot give ends the process.
"""

import zlib
from pathlib import Path
from typing import NamedTuple

from labcrane.errors import RecordingError

WINDOW = 1 << 22
BEHIND = WINDOW // 8
"""Bytes kept before the requested ones: comparing a chunk with its check goes back to them."""


class FileWindow(NamedTuple):
    """Bytes of a file, and where the first of them lies in it."""

    data: bytes
    start: int


class FileBytes:
    """A file at its present length; bytes that are appended later are not seen.

    Parameters
    ----------
    path
        Opened for each reading, so that nothing keeps it open.

    Raises
    ------
    RecordingError
        From every method: it cannot be read, or has become shorter.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._window = FileWindow(b"", 0)
        try:
            self._size = path.stat().st_size
        except OSError as error:
            raise RecordingError(f"cannot read {path}: {error.strerror}") from error
        self.window(0, min(self._size, 1))

    def __len__(self) -> int:
        return self._size

    def __getitem__(self, span: slice) -> bytes:
        start, stop, _ = span.indices(self._size)
        if start >= stop:
            return b""
        data, at = self.window(start, stop)
        return data[start - at : stop - at]

    def window(self, start: int, stop: int) -> FileWindow:
        """Return bytes that hold ``start`` to ``stop``, and mostly more; both are in the file."""
        at, end = self._window.start, self._window.start + len(self._window.data)
        if not at <= start <= stop <= end:
            first = max(start - BEHIND, 0)
            self._window = FileWindow(self._read(first, max(stop, first + WINDOW)), first)
            if stop > first + len(self._window.data):
                raise RecordingError(f"{self._path} has become shorter while it was read")
        return self._window

    def find(self, what: bytes, start: int = 0, stop: int | None = None) -> int:
        """Return where ``what`` lies first, wholly between ``start`` and ``stop``; -1 without."""
        stop = self._size if stop is None else min(stop, self._size)
        while stop - start >= len(what):
            end = min(stop, start + WINDOW)
            data, at = self.window(start, end)
            found = data.find(what, start - at, end - at)
            if found >= 0:
                return found + at
            if end == stop:
                break
            start = end - len(what) + 1
        return -1

    def rfind(self, what: bytes, start: int = 0, stop: int | None = None) -> int:
        """Return where ``what`` lies last, wholly between ``start`` and ``stop``; -1 without."""
        stop = self._size if stop is None else min(stop, self._size)
        while stop - start >= len(what):
            begin = max(start, stop - WINDOW)
            data, at = self.window(begin, stop)
            found = data.rfind(what, begin - at, stop - at)
            if found >= 0:
                return found + at
            if begin == start:
                break
            stop = begin + len(what) - 1
        return -1

    def crc(self, start: int, stop: int, before: int = 0) -> int:
        """Return the CRC-32 of a span that follows bytes whose CRC-32 was ``before``."""
        while start < stop:
            end = min(stop, start + WINDOW)
            data, at = self.window(start, end)
            before = zlib.crc32(memoryview(data)[start - at : end - at], before)
            start = end
        return before

    def _read(self, start: int, stop: int) -> bytes:
        try:
            with self._path.open("rb", buffering=0) as file:
                file.seek(start)
                wanted = min(stop, self._size) - start
                data = file.read(wanted)
                while len(data) < wanted and (more := file.read(wanted - len(data))):
                    data += more
                return data
        except OSError as error:
            raise RecordingError(f"cannot read {self._path}: {error.strerror}") from error
