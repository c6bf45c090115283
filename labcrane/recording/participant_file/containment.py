"""Containment of a participant file: everything it holds lies in it, and is no larger than it."""

import mmap
import os
import struct
from pathlib import Path
from typing import TYPE_CHECKING, Any

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

_HEAP_SIZE = struct.Struct("<Q")
_HEAP_OBJECT = struct.Struct("<H6xQ")

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


def check_heaps(path: Path) -> None:
    """Look at the heaps of texts before HDF5 does: it reads a free space of 0 bytes for ever.

    libhdf5 1.14 advances by the size that an object of a heap (``GCOL``) states, and has no way
    out of a loop when that is 0 (H5HGcache.c). Needed for as long as a version does so.

    Raises
    ------
    RecordingError
        A heap is damaged.
    """
    status = path.stat()
    if _known(path, status) in _contained or not status.st_size:
        return
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        at = data.find(HEAP)
        while at >= 0:
            if not _heap_ends(data, at):
                raise RecordingError(
                    f"{path} is damaged: the heap of texts at byte {at} has no end; "
                    f"labcrane recover {path.parent} makes it anew of the journals, if they are "
                    "there"
                )
            at = data.find(HEAP, at + len(HEAP))


def _heap_ends(data: mmap.mmap, at: int) -> bool:
    """Whether the objects of a heap fill it, each larger than nothing."""
    if at + 16 > len(data):
        return True  # HDF5 refuses it
    (size,) = _HEAP_SIZE.unpack_from(data, at + 8)
    position, stop = at + 16, at + size
    while position + 16 <= min(stop, len(data)):
        index, length = _HEAP_OBJECT.unpack_from(data, position)
        step = length if index == 0 else 16 + (length + 7) // 8 * 8
        if step <= 0 or step > stop - position:
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
