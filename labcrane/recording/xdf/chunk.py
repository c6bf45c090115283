"""Chunks as XDF 1.0 packs them (https://github.com/sccn/xdf/wiki/Specifications).

A chunk is a variable-length length, a tag of two bytes and the content; all numbers are little
endian. labcrane always writes lengths and sample counts in four bytes, so that chunks of equal
content have equal size.
"""

import struct
from collections.abc import Sequence
from enum import IntEnum

import numpy as np
import numpy.typing as npt

from labcrane.types import FloatArray

MAGIC = b"XDF:"
BOUNDARY = bytes.fromhex("43a546dccbf5410fb30ed5467383cbe4")


class Tag(IntEnum):
    """Content of a chunk."""

    FILE_HEADER = 1
    STREAM_HEADER = 2
    SAMPLES = 3
    CLOCK_OFFSET = 4
    BOUNDARY = 5
    STREAM_FOOTER = 6


_HEAD = struct.Struct("<BIH")
_SAMPLES_HEAD = struct.Struct("<BIHIBI")
_STAMP = struct.Struct("<Bd")
_LENGTH = struct.Struct("<BI")
_OFFSET = struct.Struct("<Idd")
_TAG_BYTES = 2


def pack(tag: Tag, content: bytes) -> bytes:
    """Return one chunk."""
    return _HEAD.pack(4, _TAG_BYTES + len(content), tag) + content


def pack_stream(tag: Tag, stream: int, text: str) -> bytes:
    """Return the header or the footer of a stream as a chunk."""
    return pack(tag, struct.pack("<I", stream) + text.encode())


def pack_offset(stream: int, time: float, offset: float) -> bytes:
    """Return one measured clock offset as a chunk."""
    return pack(Tag.CLOCK_OFFSET, _OFFSET.pack(stream, time, offset))


def samples_head(stream: int, count: int, size: int) -> bytes:
    """Return the head of a chunk of ``count`` samples that take ``size`` bytes together."""
    content = _SAMPLES_HEAD.size - _HEAD.size + size
    return _SAMPLES_HEAD.pack(4, _TAG_BYTES + content, Tag.SAMPLES, stream, 4, count)


def sample_dtype(dtype: np.dtype[np.generic], channels: int) -> np.dtype[np.void]:
    """Return how one stamped sample of numbers lies in a chunk."""
    return np.dtype([("flag", "u1"), ("stamp", "<f8"), ("values", dtype, (channels,))])


def pack_numbers(
    stream: int, stamps: FloatArray, data: npt.NDArray[np.generic], dtype: np.dtype[np.generic]
) -> bytes:
    """Return a chunk of numeric samples, ``data`` of shape ``(n_samples, n_channels)``."""
    samples = np.empty(len(stamps), sample_dtype(dtype, data.shape[1]))
    samples["flag"] = 8
    samples["stamp"] = stamps
    samples["values"] = data
    return samples_head(stream, len(samples), samples.nbytes) + samples.tobytes()


def pack_texts(stream: int, stamps: Sequence[float], rows: Sequence[Sequence[str]]) -> bytes:
    """Return a chunk of samples that are texts, one text per channel."""
    parts = []
    for stamp, row in zip(stamps, rows, strict=True):
        parts.append(_STAMP.pack(8, stamp))
        for text in row:
            encoded = text.encode()
            parts.append(_LENGTH.pack(4, len(encoded)) + encoded)
    body = b"".join(parts)
    return samples_head(stream, len(rows), len(body)) + body
