"""Containment of a participant file: all its data are inside it, and none claims more than fits."""

import math
import os
import re
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from labcrane.errors import RecordingError
from labcrane.limits import LIMITS
from labcrane.recording.participant_file.seal import check_seal

if TYPE_CHECKING:
    import h5py

MOST_VALUES = LIMITS["participant file"].most
MOST_NODES = 200_000
DEEPEST = 32

MOST_PACKED = 1100
"""Bytes that one byte of gzip can become, and a little more."""

MOST_CHUNK_BYTES = 1 << 26
"""Of one packed chunk of a column, which is unpacked whole for the first of its values: labcrane
writes none beyond a sixty-fourth of it."""

SMALL_BYTES = 1 << 16
"""Bytes that a column may have beyond that: one without chunks of its own has no packed size."""

HEAP = b"GCOL\x01\0\0\0"
"""Where a heap of texts begins."""

_HEAP_HEAD = 16

_HEAP_SIZE = struct.Struct("<Q")
_HEAP_OBJECT = struct.Struct("<H6xQ")

TEXT_ATTRIBUTE = re.compile(rb"[\x19\x29\x39\x49]...\x10\0\0\0", re.DOTALL)
"""Where the type of an attribute begins that is a text: 16 bytes, which say where it lies."""

_TEXT_TYPE = bytes.fromhex("10000000 01000000 00000800 00000000")
"""What follows it: a type of one byte. Half of it may be damaged too."""

_ONE_VALUE = bytes.fromhex("01000000 00000000")
"""What follows that in an attribute, and in nothing else: one value, whose length is next. One byte
of it may be damaged; of the type of a column, which others may write so, more bytes are unlike."""

_TEXT_LENGTH = struct.Struct("<I")

MOST_TEXT = 1 << 20
"""Bytes of a text that is an attribute: labcrane writes none beyond 60,000."""

WINDOW = 1 << 22
"""Bytes that are looked through at once."""

_TYPE_HEAD = 8

_TEXT_BYTES = 16
"""Of a text of a length of its own: how long it is, in which heap, and where in it."""

_BEGINNING = re.compile(re.escape(HEAP) + b"|" + TEXT_ATTRIBUTE.pattern, re.DOTALL)

_LENGTH_AT = _TYPE_HEAD + len(_TEXT_TYPE) + len(_ONE_VALUE)
_LONGEST = _LENGTH_AT + _TEXT_LENGTH.size

_Span = tuple[int, int]
_Known = tuple[str, int, int, int]
_contained: dict[_Known, None] = {}
MOST_KNOWN = 4096


def check_containment(file: "h5py.File", path: Path) -> None:
    """Look at every group and column once, before anything is read from them.

    Links to other files, columns whose numbers lie in other files, links by name, circles, and
    columns that say they hold more than their bytes can are refused. A file that was found in
    order, and has not changed since, is not looked at again.

    Raises
    ------
    RecordingError
        Something of it lies outside, or cannot be as large as it says.
    """
    status = path.stat()
    known = _known(path, status)
    if known in _contained:
        return
    _Walk(path, status.st_size).group(file, "", 0)
    if len(_contained) >= MOST_KNOWN:
        _contained.clear()
    _contained[known] = None


def check_texts(file: "h5py.File", path: Path) -> None:
    """Look at what HDF5 believes of texts before it does.

    libhdf5 1.14 advances through a heap of texts (``GCOL``) by the size that an object of it
    states, and has no way out of a loop when that is 0 (H5HGcache.c). It also takes as much memory
    as a text says it is long, up to 4 GB, and fills it with zeros, before it looks whether the
    text is there (H5T__conv_vlen). Both are so in 2.0; needed for as long as a version does so.
    Opening a file and asking where its columns lie reads no text. Between the columns lies what
    has to be looked through: of an hour's file a thousandth.

    Raises
    ------
    RecordingError
        A heap has no end, a text is longer than labcrane writes it, or the file is not as it was
        written.
    """
    status = path.stat()
    if _known(path, status) in _contained:
        return
    spans = unpacked(file, status.st_size)
    with path.open("rb") as data:
        check_seal(data, path, status.st_size, spans)
        for span in spans:
            for at, begin in _found(data, *span):
                if begin.startswith(HEAP):
                    wrong = not _heap_ends(data, at, status.st_size)
                    what = f"the heap of texts at byte {at} has no end"
                else:
                    length = _attribute_length(begin)
                    wrong = length > MOST_TEXT
                    what = f"the text at byte {at} says it is {length} bytes long"
                if wrong:
                    raise RecordingError(
                        f"{path} is damaged: {what}; move it elsewhere, then run labcrane "
                        f"recover {path.parent} to rebuild it from the journals, if they exist"
                    )


def unpacked(file: "h5py.File", size: int) -> list[_Span]:
    """Return the spans of a file of ``size`` bytes that no packed column takes."""
    return _outside(_columns_in(file), size)


def _columns_in(file: "h5py.File") -> list[_Span]:
    """Return where packed chunks lie; nothing when one cannot be as large as it says."""
    import h5py  # noqa: PLC0415

    spans: list[_Span] = []
    sizes: list[bool] = []

    def look(name: str, node: "h5py.HLObject") -> bool | None:
        if name.count("/") > DEEPEST:  # the way to each costs as much as it is long
            sizes.append(False)
            return True
        if not isinstance(node, h5py.Dataset) or node.compression != "gzip":
            return None
        most = math.prod(node.chunks) * int(node.dtype.itemsize)

        def add(chunk: "h5py.h5d.StoreInfo") -> None:
            if chunk.filter_mask:  # what packing would make larger is left as it is, without a sum
                return
            spans.append((chunk.byte_offset, chunk.byte_offset + chunk.size))
            sizes.append(chunk.size <= most + most // 100 + 64)

        node.id.chunk_iter(add)
        return None

    file.visititems(look)
    return spans if all(sizes) else []


def _outside(spans: list[_Span], size: int) -> list[_Span]:
    """Return what is left of a file; all of it where spans overlap or lie beyond its end."""
    spans = sorted(spans)
    gaps = list(
        zip([0, *(stop for _, stop in spans)], [*(at for at, _ in spans), size], strict=True)
    )
    if any(start > stop for start, stop in gaps):
        return [(0, size)]
    return [(start, stop) for start, stop in gaps if start < stop]


def _found(data: BinaryIO, start: int, stop: int) -> Iterator[tuple[int, bytes]]:
    """Yield where heaps and texts begin in a span of a file, and how."""
    while start < stop:
        data.seek(start)
        window = data.read(min(stop - start + _LONGEST, WINDOW))
        last = start + len(window) >= stop
        for match in _BEGINNING.finditer(window):
            at = match.start()
            # What begins near the end of a window is found again, whole, in the next one.
            if start + at < stop and (last or at + _LONGEST <= len(window)):
                yield start + at, window[at : at + _LONGEST]
        if last:
            return
        start += len(window) - _LONGEST + 1


def _attribute_length(begin: bytes) -> int:
    """Return the length of a text in bytes that its header states; 0 if it is not a text."""
    if len(begin) < _LONGEST:
        return 0
    space_at = _LENGTH_AT - len(_ONE_VALUE)
    kind, space = begin[_TYPE_HEAD:space_at], begin[space_at:_LENGTH_AT]
    if _alike(kind, _TEXT_TYPE) < len(_TEXT_TYPE) // 2:
        return 0
    if _alike(space, _ONE_VALUE) < len(_ONE_VALUE) - 1:
        return 0
    (width,) = _TEXT_LENGTH.unpack_from(kind, 4)
    (length,) = _TEXT_LENGTH.unpack_from(begin, _LENGTH_AT)
    return int(length * max(width, 1))


def _alike(some: bytes, others: bytes) -> int:
    return sum(a == b for a, b in zip(some, others, strict=True))


def _heap_ends(file: BinaryIO, start: int, length: int) -> bool:
    """Whether the objects of a heap fill it, each larger than nothing."""
    file.seek(start)
    data = file.read(_HEAP_HEAD)
    if len(data) < _HEAP_HEAD:
        return True  # HDF5 refuses it
    (size,) = _HEAP_SIZE.unpack_from(data, 8)
    data += file.read(max(min(size, length - start) - _HEAP_HEAD, 0))
    position = _HEAP_HEAD
    while position + _HEAP_HEAD <= min(size, len(data)):
        index, length = _HEAP_OBJECT.unpack_from(data, position)
        step = length if index == 0 else 16 + (length + 7) // 8 * 8
        if step <= 0 or step > size - position:
            return False
        position += step
    return True


def _known(path: Path, status: os.stat_result) -> _Known:
    return str(path.resolve()), status.st_size, status.st_mtime_ns, status.st_ino


class _Walk:
    def __init__(self, path: Path, size: int) -> None:
        self._path = path
        self._size = size
        self._nodes = 0
        self._seen: set[Any] = set()

    def group(self, group: "h5py.Group", at: str, depth: int) -> None:
        import h5py  # noqa: PLC0415

        if depth > DEEPEST:
            raise self._refused(at, "groups are nested deeper than labcrane writes them")
        for name in group:
            where = f"{at}/{name}"
            self._nodes += 1
            if self._nodes > MOST_NODES:
                raise self._refused(at, f"holds more than {MOST_NODES} groups and columns")
            link = group.get(name, getlink=True)
            if not isinstance(link, h5py.HardLink):
                raise self._refused(where, "is a link to somewhere else")
            node = group[name]
            self._once(node, where)
            if isinstance(node, h5py.Group):
                self.group(node, where, depth + 1)
            elif isinstance(node, h5py.Dataset):
                self._dataset(node, where)

    def _once(self, node: "h5py.HLObject", where: str) -> None:
        import h5py  # noqa: PLC0415

        address = h5py.h5o.get_info(node.id).addr
        if address in self._seen:
            raise self._refused(where, "is listed twice, or contains itself")
        self._seen.add(address)

    def _dataset(self, dataset: "h5py.Dataset", where: str) -> None:
        if dataset.external or dataset.is_virtual:
            raise self._refused(where, "has its values in another file")
        size = int(dataset.size or 0)
        width = int(dataset.dtype.itemsize)
        packed = min(int(dataset.id.get_storage_size()), self._size)
        if size > MOST_VALUES or size * width > MOST_PACKED * packed + SMALL_BYTES:
            raise self._refused(
                where, f"says it holds {size} values of {width} bytes in {packed} bytes"
            )
        chunk = math.prod(dataset.chunks or ()) * width
        if chunk > MOST_CHUNK_BYTES:
            raise self._refused(where, f"is packed in chunks of {chunk} bytes")
        if dataset.dtype.kind == "O" and dataset.chunks is None and size:
            self._texts(dataset, where, size)

    def _texts(self, dataset: "h5py.Dataset", where: str, size: int) -> None:
        """Look at the lengths of an older file's texts; where they are packed, gzip adds a sum."""
        at = dataset.id.get_offset()
        if at is None:
            return
        with self._path.open("rb") as data:
            data.seek(at)
            said = data.read(_TEXT_BYTES * size)
        for start in range(0, len(said) - _TEXT_LENGTH.size + 1, _TEXT_BYTES):
            (length,) = _TEXT_LENGTH.unpack_from(said, start)
            if length > self._size:
                raise self._refused(where, f"says it holds a text of {length} bytes")

    def _refused(self, where: str, what: str) -> RecordingError:
        return RecordingError(
            f"{self._path} is not as labcrane writes it: {where or '/'} {what}; use an "
            f"unchanged copy, or run labcrane recover {self._path.parent} if the journals exist"
        )
