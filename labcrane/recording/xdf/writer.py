"""Writer of XDF 1.0 files that a killed process leaves readable.

Every call is one write to the operating system. Beside what the specification asks for, a stream
of its own, ``labcrane.check``, holds the running CRC-32 of all that was written
(docs/decisions/0003-recordings-verify-themselves.md).
"""

import struct
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Self

import numpy as np
import numpy.typing as npt

from labcrane.errors import RecordingError
from labcrane.files.append import SYNC_S, AppendFile
from labcrane.recording.paths import part_number
from labcrane.recording.xdf.checksums import CHECK_HEADER, CHECK_ID, CheckLog
from labcrane.recording.xdf.chunk import (
    MAGIC,
    Tag,
    pack,
    pack_numbers,
    pack_offset,
    pack_stream,
    pack_texts,
    samples_head,
)
from labcrane.recording.xdf.header import StreamHeader
from labcrane.types import FloatArray

CHECK_EVERY_S = 1.0
"""Seconds of writing between two boundary chunks, each followed by the checks of what is new."""

_STAMP = struct.Struct("<Bd")


@dataclass
class _Written:
    """Content of a stream's footer."""

    header: StreamHeader
    head: bytes
    count: int = 0
    first: float = 0.0
    last: float = 0.0
    offsets: list[tuple[float, float]] = field(default_factory=list)

    def add(self, stamps: Sequence[float] | FloatArray) -> None:
        """Count samples that are in the file now."""
        if not len(stamps):
            return
        if self.count == 0:
            self.first = float(stamps[0])
        self.last = float(stamps[-1])
        self.count += len(stamps)

    def footer(self) -> str:
        """Return the stream's footer as XML."""
        span = self.last - self.first
        rate = (self.count - 1) / span if self.count > 1 and span > 0 else 0.0
        offsets = "".join(
            f"<offset><time>{when!r}</time><value>{value!r}</value></offset>"
            for when, value in self.offsets
        )
        return (
            f'<?xml version="1.0"?><info><first_timestamp>{self.first!r}</first_timestamp>'
            f"<last_timestamp>{self.last!r}</last_timestamp>"
            f"<sample_count>{self.count}</sample_count><measured_srate>{float(rate)!r}</measured_srate>"
            f"<clock_offsets>{offsets}</clock_offsets></info>"
        )


class XdfWriter:
    """A new XDF file. May be used by several threads.

    Parameters
    ----------
    path
        Must not exist; see :mod:`labcrane.recording.paths` for the names of further parts.
    sync_s
        Longest time, in seconds, that data wait for the disk.
    now
        The clock of a simulation, in seconds: its files then depend on nothing but what was
        simulated, and their dates are counted from 1970. The computer's clock by default.
    checked
        Whether the checksums are written: of a journal, not of a file for other programs, which
        would take their stream for a measurement.

    Raises
    ------
    RecordingError
        From every method: what was to be written is not in the file, everything before it is.
    """

    def __init__(
        self,
        path: Path,
        sync_s: float = SYNC_S,
        now: Callable[[], float] | None = None,
        *,
        checked: bool = True,
    ) -> None:
        self._checked = checked
        self._file = AppendFile(path, sync_s)
        self._lock = threading.Lock()
        self._streams: dict[int, _Written] = {}
        self._checks = CheckLog()
        self._now = now or time.monotonic
        self._due = self._now() + CHECK_EVERY_S
        # In one call, so that no check can come before the header of the checks.
        start = MAGIC + pack(Tag.FILE_HEADER, _file_header(part_number(path), now).encode())
        head = pack_stream(Tag.STREAM_HEADER, CHECK_ID, CHECK_HEADER.xml) if checked else b""
        self._write(start + head, 0.0)

    @property
    def path(self) -> Path:
        """Where the file is."""
        return self._file.path

    @property
    def free(self) -> int:
        """Bytes free on the disk, at most a second old."""
        return self._file.free

    @property
    def size(self) -> int:
        """Bytes written."""
        return self._file.size

    def add_stream(self, header: StreamHeader) -> int:
        """Write a stream's header and return the number under which its samples are written."""
        with self._lock:
            number = len(self._streams) + 1
            self._write(pack_stream(Tag.STREAM_HEADER, number, header.xml), self._checks.last)
            size = _STAMP.size + len(header.channels) * (
                header.dtype.itemsize if header.dtype is not None else 0
            )
            self._streams[number] = _Written(header, samples_head(number, 1, size) + b"\x08")
            return number

    def write_sample(self, stream: int, stamp: float, values: FloatArray) -> None:
        """Write one sample of a double64 stream, ``values`` of shape ``(n_channels,)``.

        ``stamp`` is in seconds on the writer's clock.

        The way of the loop: one call to the operating system, and little before it.
        """
        written = self._find(stream)
        if (
            values.dtype.char != "d"
            or values.shape != (len(written.header.channels),)
            or written.header.format != "double64"
        ):
            raise _misfit(written.header, values)
        block = written.head + struct.pack("<d", stamp) + values.tobytes()
        with self._lock:
            self._write(block, stamp)
            written.add((stamp,))

    def write_samples(self, stream: int, stamps: FloatArray, data: npt.NDArray[np.generic]) -> None:
        """Write samples of a stream of numbers as one chunk.

        Parameters
        ----------
        stream
            As :meth:`add_stream` gave it.
        stamps
            One per sample, in seconds, shape ``(n_samples,)``.
        data
            Shape ``(n_samples, n_channels)``, of the stream's number format.
        """
        written = self._find(stream)
        dtype = written.header.dtype
        if (
            dtype is None
            or data.dtype != dtype
            or data.shape != (len(stamps), len(written.header.channels))
        ):
            raise _misfit(written.header, data)
        if len(stamps):
            self._add(written, stamps, pack_numbers(stream, stamps, data, dtype))

    def write_texts(
        self, stream: int, stamps: Sequence[float], rows: Sequence[Sequence[str]]
    ) -> None:
        """Write samples of a stream of texts as one chunk.

        A row has one text per channel; ``stamps`` are in seconds, one per row.
        """
        written = self._find(stream)
        channels = len(written.header.channels)
        if written.header.format != "string" or any(len(row) != channels for row in rows):
            raise RecordingError(
                f"stream {written.header.name!r} holds {channels} channels of "
                f"{written.header.format}; rows of texts of another length cannot be written to it"
            )
        if rows:
            self._add(written, stamps, pack_texts(stream, stamps, rows))

    def write_offset(self, stream: int, when: float, offset: float) -> None:
        """Write a clock offset: at ``when``, the stream's clock plus ``offset`` was ours."""
        written = self._find(stream)
        with self._lock:
            self._write(pack_offset(stream, when, offset), self._checks.last)
            written.offsets.append((float(when), float(offset)))

    def sync(self) -> None:
        """Bring all that was written to the disk now."""
        self._file.sync()

    def close(self) -> None:
        """Write the footers and close the file; a second call does nothing."""
        if self._file.closed:
            return
        try:
            with self._lock:
                for number, written in self._streams.items():
                    footer = pack_stream(Tag.STREAM_FOOTER, number, written.footer())
                    self._write(footer, self._checks.last)
                if self._checked:
                    self._write_last_checks()
        finally:
            self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *raised: object) -> None:
        self.close()

    def _find(self, stream: int) -> _Written:
        try:
            return self._streams[stream]
        except KeyError:
            raise RecordingError(
                f"{self.path} has no stream {stream}; add_stream gave {len(self._streams)} numbers"
            ) from None

    def _add(self, written: _Written, stamps: Sequence[float] | FloatArray, block: bytes) -> None:
        with self._lock:
            self._write(block, float(stamps[-1]))
            written.add(stamps)

    def _write(self, chunk: bytes, stamp: float) -> None:
        """Write a chunk and note its check; once a second the checks go with it, in one call."""
        if not self._checked:
            self._file.write(chunk)
        elif (now := self._now()) < self._due:
            self._file.write(chunk)
            self._checks.add(chunk, stamp)
        else:
            checks = self._checks.added(chunk, stamp)
            self._file.write(chunk + checks.seal())
            self._checks = checks
            self._due = now + CHECK_EVERY_S

    def _write_last_checks(self) -> None:
        """Write the check stream's own footer, and the checks of all; nothing follows them."""
        checks = self._checks
        count = checks.count + checks.waiting + 2  # the footer and the boundary count as well
        footer = _Written(CHECK_HEADER, b"", count, 0.0, float(checks.last)).footer()
        chunk = pack_stream(Tag.STREAM_FOOTER, CHECK_ID, footer)
        checks = checks.added(chunk, checks.last)
        self._file.write(chunk + checks.seal())
        self._checks = checks


def _file_header(part: int, now: Callable[[], float] | None) -> str:
    moment = datetime.fromtimestamp(now(), UTC) if now else datetime.now().astimezone()
    started = moment.isoformat()
    return (
        '<?xml version="1.0"?><info><version>1.0</version>'
        f"<datetime>{started}</datetime><writer>labcrane</writer><part>{part}</part></info>"
    )


def _misfit(header: StreamHeader, data: npt.NDArray[np.generic]) -> RecordingError:
    return RecordingError(
        f"stream {header.name!r} holds {len(header.channels)} channels of {header.format}; "
        f"an array of shape {data.shape} and type {data.dtype} cannot be written to it"
    )
