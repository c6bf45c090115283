"""Writer of MAT files of version 5, whose long columns are never in memory as a whole.

An array of that format says its length before its content, and so does whatever it is in. So each
element knows its length first, and hands out its bytes a piece at a time when it is written
(*MAT-File Format*, The MathWorks, R2023b, chapter 1).
"""

import struct as packing
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

INT8, INT32, UINT32, DOUBLE, MATRIX, COMPRESSED, UTF8 = 1, 5, 6, 9, 14, 15, 16
CELL, STRUCT, CHAR, NUMBERS = 1, 2, 4, 6
NAME_BYTES = 64
"""Bytes of the name of a field, with the zero at its end: MATLAB's own names have 63 at most."""

TOGETHER = 1 << 16
"""Bytes that are compressed at once: elements may be as short as a letter."""

Pieces = Callable[[], Iterable[bytes]]


@dataclass(frozen=True)
class Element:
    """An array.

    Attributes
    ----------
    size
        Bytes of it, with its tag.
    pieces
        Returns these bytes in chunks, from the beginning at each call.
    """

    size: int
    pieces: Pieces


def numbers(count: int, pieces: Callable[[], Iterable[Any]]) -> Element:
    """Return a column of numbers, as doubles.

    Parameters
    ----------
    count
        How many there are.
    pieces
        Returns them as NumPy arrays, one after another.
    """

    def content() -> Iterator[bytes]:
        yield _tag(DOUBLE, 8 * count)
        for piece in pieces():
            yield np.ascontiguousarray(piece, "<f8").tobytes()

    return _matrix(NUMBERS, _column(count), 8 + 8 * count, content)


def cells(elements: Sequence[Element]) -> Element:
    """Return a column of cells."""

    def content() -> Iterator[bytes]:
        for element in elements:
            yield from element.pieces()

    return _matrix(CELL, _column(len(elements)), sum(each.size for each in elements), content)


def texts(count: int, pieces: Callable[[], Iterable[str]]) -> Element:
    """Return a column of cells with texts, which are gone through twice, one after another."""

    def content() -> Iterator[bytes]:
        for each in pieces():
            yield from text(each).pieces()

    return _matrix(CELL, _column(count), sum(text(each).size for each in pieces()), content)


def text(letters: str) -> Element:
    """Return a text."""
    encoded = letters.encode()
    padded = encoded + bytes(-len(encoded) % 8)
    shape = (1, len(letters)) if letters else (0, 0)
    return _matrix(CHAR, shape, 8 + len(padded), lambda: [_tag(UTF8, len(encoded)), padded])


def struct(fields: Mapping[str, Element]) -> Element:
    """Return a struct, with its fields in order."""
    names = b"".join(name.encode("ascii").ljust(NAME_BYTES, b"\0") for name in fields)
    # The length of a name is so short that it is in its own tag.
    head = packing.pack("<HHi", INT32, 4, NAME_BYTES) + _tag(INT8, len(names)) + names

    def content() -> Iterator[bytes]:
        yield head
        for field in fields.values():
            yield from field.pieces()

    size = len(head) + sum(field.size for field in fields.values())
    return _matrix(STRUCT, (1, 1), size, content)


def write_mat(path: Path, name: str, element: Element) -> None:
    """Write a file of one variable, compressed."""
    named = Element(element.size + _padded(len(name)), lambda: _named(name, element))
    packer = zlib.compressobj()
    with path.open("wb") as file:
        file.write(b"MATLAB 5.0 MAT-file, written by labcrane".ljust(124) + b"\x00\x01IM")
        file.write(_tag(COMPRESSED, 0))
        for piece in _together(named.pieces()):
            file.write(packer.compress(piece))
        file.write(packer.flush())
        size = file.tell() - 136
        file.seek(128)
        file.write(_tag(COMPRESSED, size))


def _matrix(kind: int, shape: tuple[int, int], size: int, content: Pieces) -> Element:
    """Return an array without a name, as those in others are."""
    head = _tag(UINT32, 8) + packing.pack("<II", kind, 0)
    head += _tag(INT32, 8) + packing.pack("<ii", *shape) + _tag(INT8, 0)

    def pieces() -> Iterator[bytes]:
        # What is too large for a tag is refused before it is written.
        yield _tag(MATRIX, len(head) + size) + head
        yield from content()

    return Element(8 + len(head) + size, pieces)


def _column(count: int) -> tuple[int, int]:
    return (count, 1) if count else (0, 0)


def _named(name: str, element: Element) -> Iterator[bytes]:
    """Yield an array of the file itself: its name is behind 8 + 16 + 16 bytes."""
    pieces = iter(element.pieces())
    head = next(pieces)
    letters = name.encode("ascii").ljust(_padded(len(name)), b"\0")
    yield _tag(MATRIX, element.size - 8 + len(letters)) + head[8:40]
    yield _tag(INT8, len(name)) + letters
    yield head[48:]
    yield from pieces


def _together(pieces: Iterable[bytes]) -> Iterator[bytes]:
    waiting = bytearray()
    for piece in pieces:
        waiting += piece
        if len(waiting) >= TOGETHER:
            yield bytes(waiting)
            waiting.clear()
    yield bytes(waiting)


def _padded(size: int) -> int:
    return size + -size % 8


def _tag(kind: int, size: int) -> bytes:
    return packing.pack("<II", kind, size)
