"""Checksums that show which bytes of a journal are unchanged since they were written.

XDF has no checksums, so labcrane writes a stream of its own, ``labcrane.check``. Each sample
says where a chunk ends and what the CRC-32 of the file up to there is. Any stretch between two
known ends can be verified alone: ``crc32(data[a:b], crc_a) == crc_b``
(docs/decisions/0003-recordings-verify-themselves.md).
"""

import itertools
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from labcrane.recording.xdf.chunk import BOUNDARY, Tag, pack, sample_dtype, samples_head
from labcrane.recording.xdf.file_bytes import FileBytes
from labcrane.recording.xdf.header import Channel, StreamHeader

CHECK_ID = 0x4B434843  # "CHCK": found without its header, should that be what is damaged
CHECK_NAME = "labcrane.check"
CHECK_HEADER = StreamHeader(
    name=CHECK_NAME,
    type="Checksum",
    channels=(Channel("end", "byte"), Channel("crc32", "1")),
    source_id=CHECK_NAME,
)

_ENTRY = struct.Struct("<Bddd")
_ENTRY_DTYPE = sample_dtype(np.dtype("<f8"), 2)
_HEAD = samples_head(CHECK_ID, 0, 0)


@dataclass
class CheckLog:
    """The checks of a file that is being written.

    Attributes
    ----------
    size, crc
        Bytes so far, and their CRC-32.
    count
        Samples written to the check stream.
    entries
        Samples that wait to be written.
    last
        Stamp of the last chunk, in seconds.
    """

    size: int = 0
    crc: int = 0
    count: int = 0
    entries: bytearray = field(default_factory=bytearray)
    last: float = 0.0

    def add(self, chunk: bytes, stamp: float) -> None:
        """Note a chunk that was written."""
        self.size += len(chunk)
        self.crc = zlib.crc32(chunk, self.crc)
        self.entries += _ENTRY.pack(8, stamp, self.size, self.crc)
        self.last = stamp

    def added(self, chunk: bytes, stamp: float) -> "CheckLog":
        """Return the log with one chunk more; this one stays unchanged."""
        after = replace(self, entries=bytearray(self.entries))
        after.add(chunk, stamp)
        return after

    @property
    def waiting(self) -> int:
        """How many entries wait to be written."""
        return len(self.entries) // _ENTRY.size

    def seal(self) -> bytes:
        """Return a boundary and the checks of all up to it; note these two as written."""
        boundary = pack(Tag.BOUNDARY, BOUNDARY)
        self.add(boundary, self.last)
        checks = samples_head(CHECK_ID, self.waiting, len(self.entries)) + bytes(self.entries)
        self.count += self.waiting
        self.entries = bytearray()
        self.add(checks, self.last)
        return boundary + checks


class ByteSpan(NamedTuple):
    """A span of a file, in bytes."""

    start: int
    stop: int


class _Block(NamedTuple):
    """One chunk of checks: where it lies, and the ends and checks it holds."""

    start: int
    stop: int
    ends: list[int]
    crcs: list[int]


class FileState(NamedTuple):
    """What is known of a file.

    Attributes
    ----------
    damaged
        Stretches, each from one end of a chunk to another, that are not as they were written.
    unchecked
        Stretches, before the last good check, of which nothing is known: their checks are damaged.
    checked
        Up to where the file is covered by checks, in bytes.
    """

    damaged: list[ByteSpan]
    unchecked: list[ByteSpan]
    checked: int


def verify(data: FileBytes) -> FileState:
    """Compare a file with the checks it holds."""
    last = _last_block(data)
    if last is None:
        return FileState([], [], 0)
    if data.crc(0, last.start) == last.crcs[-1]:
        return FileState([], [], last.stop)
    damaged: list[ByteSpan] = []
    unchecked: list[ByteSpan] = []
    end, crc, follows = 0, 0, 0
    for block in _blocks(data):
        bad = _mismatches(data, block, end, crc)
        if bad and bad[0].start == end and block.ends[0] != follows:
            unchecked.append(bad.pop(0))  # the checks in between are missing: it is many chunks
        damaged += bad
        end, crc, follows = block.start, block.crcs[-1], block.stop
    return FileState(damaged, unchecked, last.stop)


def _mismatches(data: FileBytes, block: _Block, end: int, crc: int) -> list[ByteSpan]:
    """Return the spans of a block that differ from their checks; ``crc`` is known up to ``end``."""
    if data.crc(end, block.start, crc) == block.crcs[-1]:
        return []
    bad = []
    ends = itertools.pairwise([end, *block.ends])
    for span, (before, after) in zip(ends, itertools.pairwise([crc, *block.crcs]), strict=True):
        if data.crc(*span, before) != after:
            bad.append(ByteSpan(*span))
    return bad


def _blocks(data: FileBytes) -> Iterator[_Block]:
    """Yield the chunks of checks behind boundaries that make sense in themselves."""
    position = data.find(BOUNDARY)
    while position >= 0:
        start = position + len(BOUNDARY)
        if (block := _block(data, start)) is not None:
            yield block
        position = data.find(BOUNDARY, start)


def _last_block(data: FileBytes) -> _Block | None:
    position = data.rfind(BOUNDARY)
    while position >= 0:
        if (block := _block(data, position + len(BOUNDARY))) is not None:
            return block
        position = data.rfind(BOUNDARY, 0, position)
    return None


def _block(data: FileBytes, start: int) -> _Block | None:
    body = start + len(_HEAD)
    count = int.from_bytes(data[body - 4 : body], "little")
    stop = body + count * _ENTRY.size
    head = samples_head(CHECK_ID, count, count * _ENTRY.size) if stop <= len(data) else b""
    if not count or data[start:body] != head:
        return None
    entries = np.frombuffer(data[body:stop], _ENTRY_DTYPE, count)
    values = entries["values"]
    if not np.isfinite(values).all() or values.min() < 0 or values.max() >= 2**53:
        return None
    if not np.array_equal(values, np.floor(values)):
        return None
    ends, crcs = values.astype(np.int64).T.tolist()
    if ends[-1] != start or any(b <= a for a, b in itertools.pairwise(ends)):
        return None
    return _Block(start, stop, ends, crcs)
