"""Seal of a participant file: a checksum of all bytes that have none in HDF5.

gzip adds a checksum to every packed chunk of a column, and HDF5 refuses a chunk that does not match
it. Short columns, texts, units and HDF5's own tables have none. Their checksum follows the end of
the file, where HDF5 does not look; a program that changes the file with HDF5 cuts it off.
"""

import struct
import zlib
from collections.abc import Iterable
from pathlib import Path
from typing import BinaryIO

from labcrane.errors import RecordingError

_SEAL = struct.Struct("<16sQI4s")
_BEGIN, _END = b"labcrane sum 1\r\n", b"\x89\r\n\n"

WINDOW = 1 << 22

Span = tuple[int, int]


def sealed(data: BinaryIO, size: int) -> int | None:
    """Return the sum that a file of ``size`` bytes ends with; None where it was never sealed."""
    if size < _SEAL.size:
        return None
    data.seek(size - _SEAL.size)
    begin, length, total, end = _SEAL.unpack(data.read(_SEAL.size))
    if (begin, length, end) != (_BEGIN, size - _SEAL.size, _END):
        return None
    return int(total)


def seal(path: Path, spans: Iterable[Span]) -> None:
    """Append the checksum of some spans of a file to its end."""
    size = path.stat().st_size
    with path.open("r+b") as data:
        total = sum_of(data, spans)
        data.seek(size)
        data.write(_SEAL.pack(_BEGIN, size, total, _END))


def check_seal(data: BinaryIO, path: Path, size: int, spans: Iterable[Span]) -> None:
    """Compare the checksum at a file's end, if there is one, with that of its spans.

    Raises
    ------
    RecordingError
        The file is not as it was written.
    """
    expected = sealed(data, size)
    within = ((start, min(stop, size - _SEAL.size)) for start, stop in spans)
    if expected is not None and sum_of(data, within) != expected:
        raise RecordingError(
            f"{path} is damaged: its bytes are not those that were written; move it elsewhere, "
            f"then run labcrane recover {path.parent} to rebuild it from the journals, "
            "if they exist"
        )


def sum_of(data: BinaryIO, spans: Iterable[Span]) -> int:
    """Return the CRC-32 of spans of a file."""
    total = 0
    for start, stop in spans:
        data.seek(start)
        left = stop - start
        while left > 0 and (window := data.read(min(left, WINDOW))):
            total = zlib.crc32(window, total)
            left -= len(window)
    return total
