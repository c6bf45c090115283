"""Reader of XDF files, whole ones, torn ones and damaged ones.

What is whole is read; what is not is reported. Journals of labcrane are verified against the checks
they hold; in other files damage shows only where it breaks the structure of the chunks.
"""

import struct
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt

from labcrane.errors import RecordingError
from labcrane.recording.xdf.checksums import CHECK_ID, ByteSpan, FileState, verify
from labcrane.recording.xdf.chunk import MAGIC, Tag
from labcrane.recording.xdf.file_bytes import FileBytes
from labcrane.recording.xdf.header import StreamHeader
from labcrane.recording.xdf.samples import Texts, numbers, unpack
from labcrane.recording.xdf.scanner import Chunk, ChunkScanner
from labcrane.types import FloatArray

__all__ = ["ByteSpan", "Texts", "XdfFile", "XdfStream", "read_xdf"]

_ID = struct.Struct("<I")
_OFFSET = struct.Struct("<dd")


@dataclass
class XdfStream:
    """One stream of a file.

    Attributes
    ----------
    number
        Under which it is written in the file.
    header
        As it was written.
    stamps
        Seconds on the clock of the stream's source, shape ``(n_samples,)``.
    texts
        One tuple of texts per sample; empty for numbers.
    offsets
        Measured clock offsets, shape ``(n_offsets, 2)``: when, and how much, in seconds.
    footer
        The XML of the footer; None when the writer was killed.
    """

    number: int
    header: StreamHeader
    stamps: FloatArray
    texts: Texts
    offsets: FloatArray
    footer: str | None
    _bytes: FileBytes
    _chunks: Sequence[Chunk]

    def blocks(self) -> Iterator[npt.NDArray[np.generic]]:
        """Yield the numbers of all samples, read again, in blocks of a few MB at most.

        Each of shape ``(n, n_channels)``, in the stream's number format; none of a stream of texts.
        """
        return numbers(self._bytes, self.header, self._chunks)

    @cached_property
    def data(self) -> npt.NDArray[np.generic]:
        """All numbers, shape ``(n_samples, n_channels)``; empty for texts."""
        dtype = np.dtype(np.float64) if self.header.dtype is None else self.header.dtype
        whole = np.empty((0 if self.texts else len(self.stamps), len(self.header.channels)), dtype)
        end = 0
        for block in self.blocks():
            whole[end : end + len(block)] = block
            end += len(block)
        return whole


@dataclass
class XdfFile:
    """The content of a file, as far as it could be read.

    Attributes
    ----------
    header
        The XML of the file header.
    streams
        In the order of the file.
    torn
        Bytes of the last, incomplete chunk: what a kill cut off.
    damaged
        Stretches of the file that are not as they were written, and were left out.
    unchecked
        Stretches that were read although the checks that covered them are damaged.
    checked
        Up to where the file was verified, in bytes; 0 in files of others.
    nameless
        Numbers of streams that have samples, but whose header is damaged or missing.
    """

    path: Path
    header: str
    streams: list[XdfStream]
    torn: int
    damaged: list[ByteSpan]
    unchecked: list[ByteSpan]
    checked: int
    nameless: list[int]

    @property
    def whole(self) -> bool:
        """Whether everything that was written could be read."""
        return not (self.torn or self.damaged or self.unchecked or self.nameless)

    def stream(self, name: str) -> XdfStream:
        """Return the stream called ``name``."""
        for stream in self.streams:
            if stream.header.name == name:
                return stream
        known = ", ".join(stream.header.name for stream in self.streams) or "nothing"
        lost = f"; the headers of {len(self.nameless)} streams are damaged" if self.nameless else ""
        raise RecordingError(f"{self.path} has no stream {name!r}; it has {known}{lost}")


@dataclass
class _Parts:
    """The chunks of a file, by what they hold."""

    file_header: str = ""
    headers: dict[int, StreamHeader] = field(default_factory=dict)
    samples: dict[int, list[Chunk]] = field(default_factory=lambda: defaultdict(list))
    offsets: dict[int, list[tuple[float, float]]] = field(default_factory=lambda: defaultdict(list))
    footers: dict[int, str] = field(default_factory=dict)


def read_xdf(path: Path) -> XdfFile:
    """Read an XDF file, also while it is being written, or after its writer was killed.

    Raises
    ------
    RecordingError
        The file cannot be opened, or is not an XDF file.
    """
    data = FileBytes(path)
    verdict = verify(data)
    if (start := data[: len(MAGIC)]) != MAGIC and not verdict.checked:
        if MAGIC.startswith(start):  # killed before the first chunk
            return XdfFile(path, "", [], len(data), [], [], 0, [])
        raise RecordingError(f"{path} is not an XDF file: it starts with {start!r}, not {MAGIC!r}")
    return _read(path, data, verdict)


def _read(path: Path, data: FileBytes, verdict: FileState) -> XdfFile:
    walk = ChunkScanner(data, verdict.damaged, verdict.unchecked)
    parts = _sort(data, walk)
    streams = []
    for number, header in parts.headers.items():
        chunks = parts.samples.pop(number, [])
        stamps, texts, whole = unpack(data, header, chunks, walk.skipped)
        offsets = np.array(parts.offsets[number], np.float64).reshape(-1, 2)
        footer = parts.footers.get(number)
        streams.append(XdfStream(number, header, stamps, texts, offsets, footer, data, whole))
    return XdfFile(
        path=path,
        header=parts.file_header,
        streams=streams,
        torn=walk.torn,
        damaged=sorted(walk.skipped),
        unchecked=verdict.unchecked,
        checked=verdict.checked,
        nameless=sorted(parts.samples),
    )


def _sort(data: FileBytes, walk: ChunkScanner) -> _Parts:
    """Sort the chunks by stream and content; what makes no sense is added to ``walk.skipped``."""
    parts = _Parts()
    for chunk in walk:
        if chunk.tag == Tag.FILE_HEADER:
            parts.file_header = data[chunk.body : chunk.stop].decode(errors="replace")
        elif chunk.tag != Tag.BOUNDARY:
            if chunk.stop - chunk.body < _ID.size:
                walk.skipped.append(ByteSpan(chunk.start, chunk.stop))
                continue
            (stream,) = _ID.unpack(data[chunk.body : chunk.body + _ID.size])
            if stream != CHECK_ID:
                _sort_in(parts, data, chunk, stream, walk.skipped)
    return parts


def _sort_in(
    parts: _Parts, data: FileBytes, chunk: Chunk, stream: int, skipped: list[ByteSpan]
) -> None:
    content = slice(chunk.body + _ID.size, chunk.stop)
    if chunk.tag == Tag.SAMPLES:
        parts.samples[stream].append(chunk)
    elif chunk.tag == Tag.STREAM_HEADER:
        try:
            header = StreamHeader.from_xml(data[content].decode(errors="replace"))
        except RecordingError:
            skipped.append(ByteSpan(chunk.start, chunk.stop))
        else:
            parts.headers.setdefault(stream, header)
    elif chunk.tag == Tag.STREAM_FOOTER:
        parts.footers[stream] = data[content].decode(errors="replace")
    elif chunk.stop - content.start == _OFFSET.size:
        parts.offsets[stream].append(_OFFSET.unpack(data[content]))
    else:
        skipped.append(ByteSpan(chunk.start, chunk.stop))
