"""Scanner of the chunks of an XDF file, which goes past what is damaged."""

import struct
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from labcrane.recording.xdf.checksums import ByteSpan
from labcrane.recording.xdf.chunk import BOUNDARY, Tag
from labcrane.recording.xdf.file_bytes import WINDOW, FileBytes

_WIDTHS = {1: "<B", 4: "<I", 8: "<Q"}
_TAG = struct.Struct("<H")
_TAGS = frozenset(Tag)
_LONGEST_HEAD = 1 + 8 + 2
_RUN_HEAD = 5 + 2 + 4 + 5 + 1
"""Bytes that the single samples of one stream have in common: length, tag, stream, count, flag."""


class Chunk(NamedTuple):
    """One chunk, or ``count`` of the same stream and size one behind the other.

    Attributes
    ----------
    start, stop
        Where the first one lies in the file, in bytes.
    tag
        What it holds.
    body
        Where the content of the first one starts.
    """

    start: int
    stop: int
    tag: int
    body: int
    count: int = 1  # type: ignore[assignment]


class ChunkScanner:
    """The chunks of a file, and the spans without any.

    Parameters
    ----------
    data
        The file.
    damaged, unchecked
        Known facts about it: spans to leave out, and spans that may be damaged.

    Attributes
    ----------
    skipped
        Stretches that could not be read, known when the walk is over.
    torn
        Bytes of the last, incomplete chunk, 0 if there is none; known when the walk is over.
    """

    def __init__(
        self, data: FileBytes, damaged: Sequence[ByteSpan] = (), unchecked: Sequence[ByteSpan] = ()
    ) -> None:
        self.skipped: list[ByteSpan] = list(damaged)
        self.torn = 0
        self._data = data
        # A chunk is known to start behind every such span, whatever came before.
        starts = [0, *(span.stop for span in (*damaged, *unchecked))]
        stops = [*(span.start for span in damaged), *(span.stop for span in unchecked), len(data)]
        self._stretches = [
            ByteSpan(a, b) for a, b in zip(sorted(starts), sorted(stops), strict=True) if a < b
        ]

    def __iter__(self) -> Iterator[Chunk]:
        for stretch in self._stretches:
            yield from self._walk(stretch)

    def _walk(self, stretch: ByteSpan) -> Iterator[Chunk]:
        position, stop = stretch
        if position == 0:
            position = 4  # the magic
        while position < stop:
            chunk = self._chunk(position, stop)
            if chunk is None:
                position = self._skip(position, stop)
                continue
            chunk = self._extend(chunk, stop)
            yield chunk
            position = chunk.start + chunk.count * (chunk.stop - chunk.start)

    def _chunk(self, position: int, stop: int) -> Chunk | None:
        """Return the chunk at ``position``; None when what lies there is no whole chunk."""
        head, at = self._data.window(position, min(position + _LONGEST_HEAD, stop))
        found = read_length(head, position - at, min(stop - at, len(head)))
        if found is None or (end := at + found[1] + found[0]) > stop or found[0] < _TAG.size:
            return None
        body = at + found[1] + _TAG.size
        (tag,) = _TAG.unpack_from(head, body - _TAG.size - at)
        # A chunk that swallows a boundary has a damaged length.
        if tag not in _TAGS or (tag != Tag.BOUNDARY and self._data.find(BOUNDARY, body, end) >= 0):
            return None
        if tag == Tag.BOUNDARY and self._data[body:end] != BOUNDARY:
            return None
        return Chunk(position, end, tag, body)

    def _skip(self, position: int, stop: int) -> int:
        """Return where to go on: behind the next boundary, or at the end."""
        found = self._data.find(BOUNDARY, position, stop)
        if found < 0:
            if stop == len(self._data):
                self.torn = stop - position
            else:
                self.skipped.append(ByteSpan(position, stop))
            return stop
        self.skipped.append(ByteSpan(position, found))
        return found + len(BOUNDARY)

    def _extend(self, chunk: Chunk, stop: int) -> Chunk:
        """Make one chunk of a run of equal ones: an hour of single samples is read at once."""
        size = chunk.stop - chunk.start
        head = self._data[chunk.start : chunk.start + _RUN_HEAD]
        if (
            chunk.tag != Tag.SAMPLES
            or size <= _RUN_HEAD
            or self._data[chunk.stop : chunk.stop + _RUN_HEAD] != head
        ):
            return chunk
        template = np.frombuffer(head, np.uint8)
        count, window = 1, 64
        most = (stop - chunk.start) // size
        while count < most:
            window = min(4 * window, most - count, max(WINDOW // size, 1))
            start = chunk.start + count * size
            rows = np.frombuffer(self._data[start : start + window * size], np.uint8)
            rows = rows.reshape(window, size)
            equal = (rows[:, :_RUN_HEAD] == template).all(axis=1)
            if not equal.all():
                count += int(equal.argmin())
                break
            count += window
        return chunk._replace(count=count)


def read_length(data: bytes, start: int, stop: int) -> tuple[int, int] | None:
    """Return a variable-length number and where it ends; None when there is none."""
    if start >= stop:
        return None
    width = _WIDTHS.get(data[start])
    if width is None or start + 1 + data[start] > stop:
        return None
    return struct.unpack_from(width, data, start + 1)[0], start + 1 + data[start]
