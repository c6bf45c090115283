"""Containment of a participant file: everything it holds lies in it, and is no larger than it."""

import math
import os
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from labcrane.errors import RecordingError
from labcrane.limits import LIMITS

if TYPE_CHECKING:
    import h5py

MOST_VALUES = LIMITS["participant file"].most
MOST_NODES = 200_000
DEEPEST = 32

MOST_PACKED = 1100
"""Bytes that one byte of gzip can become, and a little more."""

SMALL_BYTES = 1 << 16
"""What a column may hold beyond that: one without chunks of its own has no packed size."""

HEAP = b"GCOL\x01\0\0\0"
"""Where a heap of texts begins."""

_HEAP_HEAD = 16

_HEAP_SIZE = struct.Struct("<Q")
_HEAP_OBJECT = struct.Struct("<H6xQ")

WINDOW = 1 << 22
"""Bytes that are looked through at once."""

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


def check_heaps(file: "h5py.File", path: Path) -> None:
    """Look at the heaps of texts before HDF5 does: it reads a free space of 0 bytes for ever.

    libhdf5 1.14 advances by the size that an object of a heap (``GCOL``) states, and has no way
    out of a loop when that is 0 (H5HGcache.c). Needed for as long as a version does so. Opening a
    file and asking where its columns lie reads no heap. Between the columns lies what has to be
    looked through: of an hour's file a thousandth.

    Raises
    ------
    RecordingError
        A heap is damaged.
    """
    status = path.stat()
    if _known(path, status) in _contained:
        return
    with path.open("rb") as data:
        for span in _outside(_columns_in(file), status.st_size):
            for at in _heaps(data, *span):
                if not _heap_ends(data, at, status.st_size):
                    raise RecordingError(
                        f"{path} is damaged: the heap of texts at byte {at} has no end; "
                        f"labcrane recover {path.parent} makes it anew of the journals, if they "
                        "are there"
                    )


def _columns_in(file: "h5py.File") -> list[_Span]:
    """Return where chunks of columns lie; nothing when one cannot be as large as it says."""
    import h5py  # noqa: PLC0415

    spans: list[_Span] = []
    sizes: list[bool] = []

    def look(_: str, node: "h5py.HLObject") -> None:
        if not isinstance(node, h5py.Dataset) or node.chunks is None:
            return
        most = math.prod(node.chunks) * int(node.dtype.itemsize)

        def add(chunk: "h5py.h5d.StoreInfo") -> None:
            spans.append((chunk.byte_offset, chunk.byte_offset + chunk.size))
            sizes.append(chunk.size <= most + most // 100 + 64)

        node.id.chunk_iter(add)

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


def _heaps(data: BinaryIO, start: int, stop: int) -> Iterator[int]:
    """Yield where heaps begin in a stretch of a file."""
    while start < stop:
        data.seek(start)
        window = data.read(min(stop - start + len(HEAP), WINDOW))
        at = window.find(HEAP)
        while at >= 0:
            if start + at < stop:
                yield start + at
            at = window.find(HEAP, at + 1)
        if len(window) < len(HEAP):
            return
        start += max(len(window) - len(HEAP) + 1, 1)


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
            raise self._refused(where, "is there twice, or holds itself")
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

    def _refused(self, where: str, what: str) -> RecordingError:
        return RecordingError(
            f"{self._path} is not as labcrane writes it: {where or '/'} {what}; use a copy that "
            f"was not changed, or labcrane recover {self._path.parent} where the journals are"
        )
