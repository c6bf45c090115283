"""Samples of one stream of an XDF file, unpacked."""

import struct
from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from labcrane.recording.xdf.checksums import ByteSpan
from labcrane.recording.xdf.chunk import sample_dtype
from labcrane.recording.xdf.file_bytes import WINDOW, FileBytes
from labcrane.recording.xdf.header import StreamHeader
from labcrane.recording.xdf.scanner import Chunk, read_length
from labcrane.types import FloatArray

_ID_BYTES = 4
_STAMPED = 8

Texts = list[tuple[str, ...]]
"""One tuple per sample, one text per channel."""


class Samples(NamedTuple):
    """Stamps in seconds, shape ``(n_samples,)``, texts, and the chunks that hold them."""

    stamps: FloatArray
    texts: Texts
    chunks: list[Chunk]


def unpack(
    data: FileBytes, header: StreamHeader, chunks: Iterable[Chunk], skipped: list[ByteSpan]
) -> Samples:
    """Unpack the timestamps and texts of one stream; chunks that do not fit its header are skipped.

    Numbers stay in the file until they are asked for: :func:`numbers`.
    """
    stamps: list[FloatArray] = []
    texts: Texts = []
    whole: list[Chunk] = []
    last = 0.0
    for chunk in _pieces(chunks):
        window, here = _held(data, chunk)
        try:
            if header.dtype is None:
                times, rows = _texts(window, here, header, last)
                texts += rows
            else:
                times, _ = _numbers(window, here, header, header.dtype, last)
        except (struct.error, ValueError):
            skipped.append(ByteSpan(chunk.start, chunk.start + chunk.count * _size(chunk)))
            continue
        if len(times):
            last = float(times[-1])
            stamps.append(times.copy())
            whole.append(chunk)
    return Samples(np.concatenate(stamps) if stamps else np.empty(0), texts, whole)


def numbers(
    data: FileBytes, header: StreamHeader, chunks: Iterable[Chunk]
) -> Iterator[npt.NDArray[np.generic]]:
    """Yield the numbers of chunks that :func:`unpack` found whole, ``(n_samples, n_channels)``."""
    if header.dtype is None:
        return
    for chunk in chunks:
        yield _numbers(*_held(data, chunk), header, header.dtype, 0.0)[1]


def _size(chunk: Chunk) -> int:
    return chunk.stop - chunk.start


def _pieces(chunks: Iterable[Chunk]) -> Iterator[Chunk]:
    """Yield runs of chunks cut where they would fill more than a window."""
    for chunk in chunks:
        size = _size(chunk)
        most = max(WINDOW // size, 1)
        for first in range(0, chunk.count, most):
            yield _moved(chunk, first * size)._replace(count=min(most, chunk.count - first))


def _moved(chunk: Chunk, by: int) -> Chunk:
    moved = Chunk(chunk.start + by, chunk.stop + by, chunk.tag, chunk.body + by)
    return moved._replace(count=chunk.count)


def _held(data: FileBytes, chunk: Chunk) -> tuple[bytes, Chunk]:
    """Return bytes that hold a run of chunks, and where it lies in them."""
    window, at = data.window(chunk.start, chunk.start + chunk.count * _size(chunk))
    return window, _moved(chunk, -at)


def _count(data: bytes, chunk: Chunk) -> tuple[int, int]:
    """Return how many samples a chunk says it holds, and where they start."""
    found = read_length(data, chunk.body + _ID_BYTES, chunk.stop)
    if found is None:
        raise ValueError("no sample count")
    return found


def _check_count(count: int, least: int, size: int) -> None:
    """Refuse more samples than fit, before they are looked for behind the chunk."""
    if count * least > size:
        raise ValueError(f"{count} samples do not fit into {size} bytes")


def _numbers(
    data: bytes, chunk: Chunk, header: StreamHeader, dtype: np.dtype[np.generic], last: float
) -> tuple[FloatArray, npt.NDArray[np.generic]]:
    count, start = _count(data, chunk)
    sample = sample_dtype(dtype, len(header.channels))
    size = chunk.stop - chunk.start
    _check_count(count, 1 + dtype.itemsize * len(header.channels), chunk.stop - start)
    if start + count * sample.itemsize == chunk.stop:
        samples = np.ndarray(
            (chunk.count, count), sample, data, start, strides=(size, sample.itemsize)
        )
        if (samples["flag"] == _STAMPED).all():
            shape = (chunk.count * count, len(header.channels))
            return samples["stamp"].reshape(-1), samples["values"].reshape(shape)
    step = 1.0 / header.rate_hz if header.rate_hz else 0.0
    times: list[float] = []
    rows = []
    for repeat in range(chunk.count):
        position = start + repeat * size
        for _ in range(count):
            last, position = _stamp(data, position, last + step)
            rows.append(np.frombuffer(data, dtype, len(header.channels), position))
            position += dtype.itemsize * len(header.channels)
            times.append(last)
        if position != chunk.stop + repeat * size:
            raise ValueError("samples do not fill the chunk")
    return np.array(times), np.array(rows)


def _stamp(data: bytes, position: int, otherwise: float) -> tuple[float, int]:
    """Return a sample's timestamp, deduced where it was omitted, and where the values start."""
    flag = data[position] if position < len(data) else -1
    if flag == _STAMPED:
        (stamp,) = struct.unpack_from("<d", data, position + 1)
        return stamp, position + 9
    if flag != 0:
        raise ValueError("a time stamp that is neither given nor omitted")
    return otherwise, position + 1


def _texts(
    data: bytes, chunk: Chunk, header: StreamHeader, last: float
) -> tuple[FloatArray, Texts]:
    count, start = _count(data, chunk)
    size = chunk.stop - chunk.start
    _check_count(count, 1 + len(header.channels), chunk.stop - start)
    step = 1.0 / header.rate_hz if header.rate_hz else 0.0
    times: list[float] = []
    rows: Texts = []
    for repeat in range(chunk.count):
        position, stop = start + repeat * size, chunk.stop + repeat * size
        for _ in range(count):
            last, position = _stamp(data, position, last + step)
            row = []
            for _channel in header.channels:
                found = read_length(data, position, stop)
                if found is None or found[1] + found[0] > stop:
                    raise ValueError("a text does not fit the chunk")
                length, position = found
                row.append(data[position : position + length].decode(errors="replace"))
                position += length
            times.append(last)
            rows.append(tuple(row))
        if position != stop:
            raise ValueError("samples do not fill the chunk")
    return np.array(times), rows
