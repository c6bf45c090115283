"""Proof by what a file says, packed as it may be: a zipped workbook shows no name to a search.

Files are read a window at a time, however long they are. What cannot be searched, since it needs a
password, is damaged or is packed in a way that nothing here opens, is said: it is never taken for
a file without a name.
"""

import bz2
import gzip
import io
import lzma
import tarfile
import tempfile
import zipfile
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO, cast

from labcrane.participants.mentions import Mentions

DEEPEST = 4
"""Archives in archives that are opened."""

LARGEST = 2**32
"""Most bytes that are unpacked of one file; more may be an archive bomb."""

WINDOW = 1 << 20
"""Bytes that are searched at a time."""

OVERLAP = 1 << 10
"""Bytes of a window that the next one begins with: longer than a name with the text around it."""

IN_MEMORY = 1 << 24
"""Bytes of an archive in an archive that are kept in memory; a longer one goes to a file."""

HDF5, PARQUET, MATLAB5 = b"\x89HDF\r\n\x1a\n", b"PAR1", b"MATLAB 5.0"
ELEMENT, HEADER = 8, 128
COMPRESSED = 15
"""Type of an element of a MAT file that zlib has packed."""

TAR, TAR_AT = b"ustar", 257
HEAD = 512

CLOSED = {
    b"7z\xbc\xaf\x27\x1c": "it is a 7z archive",
    b"Rar!\x1a\x07": "it is a RAR archive",
    b"\x28\xb5\x2f\xfd": "it is packed by zstd",
    b"PARE": "its Parquet is encrypted",
    b"%PDF-": "a PDF's text is packed and drawn",
    b"-----BEGIN PGP MESSAGE": "it is encrypted by PGP",
    b"age-encryption.org": "it is encrypted by age",
    b"Salted__": "it is encrypted by OpenSSL",
}
"""Formats that cannot be opened here, by their first bytes."""

CLOSED_NAMES = (".gpg", ".pgp", ".age", ".enc", ".kdbx", ".hc", ".vc", ".aes", ".cpt", ".veracrypt")
"""Endings of files that are encrypted, and look like noise."""

OLE = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"
ENCRYPTED_PACKAGE = "EncryptedPackage".encode("utf-16-le")
"""Name by which an office document with a password is known, in Microsoft's older file format."""


@dataclass
class Searched:
    """Result of the search of one file.

    Attributes
    ----------
    found
        Whose pseudonyms are in it.
    closed
        What could not be searched, and why.
    """

    found: set[str] = field(default_factory=set)
    closed: list[str] = field(default_factory=list)


def mentioned(path: Path, mentions: Mentions) -> set[str]:
    """Return whose pseudonyms are in what a file holds; its name is not looked at."""
    return searched(path, mentions).found


def searched(path: Path, mentions: Mentions) -> Searched:
    """Search all that can be read in a file: its bytes, and whatever is packed in them.

    Zip (and so workbooks), tar, gzip, bzip2, xz, HDF5, Parquet and MAT are opened. Text that was
    drawn into a picture is not found.
    """
    search = _Search(mentions)
    try:
        with path.open("rb") as file:
            search.look(file, path.name, DEEPEST)
    except OSError as error:
        search.closed(path.name, f"it cannot be read ({error.strerror or error})")
    return search.done


class _Search:
    """One file's search."""

    def __init__(self, mentions: Mentions) -> None:
        self.done = Searched()
        self._mentions = mentions
        self._left = LARGEST

    def closed(self, name: str, why: str) -> None:
        """Note what cannot be searched."""
        if (line := f"{name}: {why}") not in self.done.closed:
            self.done.closed.append(line)

    def look(self, file: BinaryIO, name: str, depth: int) -> None:
        """Search a file that can be read anywhere, and what is packed in it."""
        head = file.read(HEAD)
        file.seek(0)
        why = _why_closed(head, name)
        encrypted = self._read(file)
        if why is None and encrypted and head.startswith(OLE):
            why = "it needs a password"
        opens = None if why else _opener(file, head)
        if opens and depth == 0:
            why = f"archives in archives are opened {DEEPEST} deep"
        if why:
            self.closed(name, why)
        elif opens:
            file.seek(0)
            try:
                opens(self, file, name, depth)
            except _Enough:
                self.closed(name, f"more than {LARGEST >> 30} GB are packed in it")
            except Exception as error:  # noqa: BLE001 - readers of unknown files raise anything
                self.closed(name, f"it is damaged, or packed otherwise ({type(error).__name__})")

    def text(self, content: bytes) -> None:
        """Search bytes that are at hand."""
        self._read(io.BytesIO(content))

    def unpacked(self, stream: BinaryIO, name: str, depth: int) -> None:
        """Search what comes out of an archive; another archive is put where it can be opened."""
        with tempfile.SpooledTemporaryFile(max_size=IN_MEMORY) as kept:
            while piece := stream.read(WINDOW):
                self._left -= len(piece)
                if self._left < 0:
                    raise _Enough
                kept.write(piece)
            kept.seek(0)
            self.look(cast("BinaryIO", kept), name, depth - 1)

    def _read(self, file: BinaryIO) -> bool:
        """Search bytes a window at a time; return whether they say that they need a password."""
        before, encrypted = b"", False
        while True:
            piece = _full(file, WINDOW)
            window, last = before + piece, len(piece) < WINDOW
            start = OVERLAP // 2 if before else 0
            stop = len(window) if last else len(window) - OVERLAP // 2
            self._find(window, start, stop)
            encrypted = encrypted or ENCRYPTED_PACKAGE in window
            if last:
                return encrypted
            before = window[-OVERLAP:]

    def _find(self, window: bytes, start: int, stop: int) -> None:
        found = self.done.found
        found |= self._mentions.of(window.decode("latin-1"), start, stop)
        # MAT files and Windows programs write two bytes a letter.
        if b"\x00" in window:
            for at in (0, 1):
                half = window[at::2].decode("latin-1")
                found |= self._mentions.of(half, start // 2, -(-stop // 2))


class _Enough(Exception):  # noqa: N818 - no error, but the end of a search
    """More is packed in a file than the limit allows."""


def _full(file: BinaryIO, size: int) -> bytes:
    """Return the next ``size`` bytes, fewer only at the end."""
    pieces, left = [], size
    while left > 0 and (piece := file.read(left)):
        pieces.append(piece)
        left -= len(piece)
    return b"".join(pieces)


def _why_closed(head: bytes, name: str) -> str | None:
    for begin, why in CLOSED.items():
        if head.startswith(begin):
            return why
    if Path(name).suffix.lower() in CLOSED_NAMES:
        return "its name says that it is encrypted"
    return None


_Opener = Callable[[_Search, BinaryIO, str, int], None]


def _opener(file: BinaryIO, head: bytes) -> _Opener | None:
    """Return the function that opens a file, by its first bytes."""
    for begin, opens in OPENERS.items():
        if head.startswith(begin):
            return opens
    if head[TAR_AT : TAR_AT + len(TAR)] == TAR:
        return _tar
    return _zip if zipfile.is_zipfile(file) else None


def _stream(opens: Callable[[BinaryIO], Any]) -> _Opener:
    def unpack(search: _Search, file: BinaryIO, name: str, depth: int) -> None:
        search.unpacked(opens(file), f"what is in {name}", depth)

    return unpack


def _zip(search: _Search, file: BinaryIO, name: str, depth: int) -> None:
    with zipfile.ZipFile(file) as archive:
        search.text(archive.comment)
        for member in archive.infolist():
            called = f"{member.filename} in {name}"
            search.text(member.filename.encode("utf-8", "surrogateescape") + b"\n" + member.comment)
            if member.flag_bits & 1:
                search.closed(called, "it needs a password")
                continue
            try:
                with archive.open(member) as inner:
                    search.unpacked(cast("BinaryIO", inner), called, depth)
            except DAMAGED as error:
                search.closed(called, f"it is damaged, or packed otherwise ({error})")


DAMAGED = (NotImplementedError, EOFError, OSError, zipfile.BadZipFile, zlib.error, lzma.LZMAError)
"""What a member of a zip raises that cannot be unpacked; others can be."""


def _tar(search: _Search, file: BinaryIO, name: str, depth: int) -> None:
    with tarfile.open(fileobj=file, mode="r:") as archive:
        for member in archive:
            search.text(f"{member.name}\n{member.linkname}".encode("utf-8", "surrogateescape"))
            inner = archive.extractfile(member) if member.isfile() else None
            if inner is not None:
                search.unpacked(cast("BinaryIO", inner), f"{member.name} in {name}", depth)


def _hdf5(search: _Search, file: BinaryIO, name: str, depth: int) -> None:
    import h5py  # noqa: PLC0415 - loads for a second

    def look(inside: str, node: Any) -> None:
        search.text(inside.encode("utf-8", "surrogateescape"))
        for key, value in node.attrs.items():
            search.text(f"{key} {value}".encode("utf-8", "surrogateescape"))
        if isinstance(node, h5py.Dataset) and node.dtype.kind in "OSUV" and node.dtype != "V":
            for part in _parts(node):
                search.text(_as_bytes(part))

    # Links to other files are not followed: visititems leaves them out.
    with h5py.File(file, "r") as opened:
        look("", opened)
        opened.visititems(look)


def _parts(dataset: Any) -> Iterator[Any]:
    """Yield the content of a dataset, so many rows at a time."""
    if not dataset.shape:
        yield dataset[()]
        return
    width = max(1, dataset.dtype.itemsize)
    for length in dataset.shape[1:]:
        width *= max(1, length)
    if width > IN_MEMORY:
        raise ValueError("a row that is longer than any that people write")
    rows = max(1, WINDOW // width)
    for at in range(0, dataset.shape[0], rows):
        yield dataset[at : at + rows]


def _as_bytes(value: Any) -> bytes:
    import numpy as np  # noqa: PLC0415

    if isinstance(value, bytes):
        return value
    if isinstance(value, str):
        return value.encode("utf-8", "surrogateescape")
    array = np.asarray(value)
    if array.dtype.kind == "O":
        return b"\n".join(_as_bytes(each) for each in array.ravel().tolist())
    return array.tobytes()


def _parquet(search: _Search, file: BinaryIO, name: str, depth: int) -> None:
    import pyarrow as pa  # noqa: PLC0415 - loads for a second
    from pyarrow import parquet  # noqa: PLC0415

    opened = parquet.ParquetFile(file)
    search.text(str(opened.schema_arrow.metadata).encode())
    search.text("\n".join(opened.schema_arrow.names).encode())
    for number in range(opened.num_row_groups):
        for at in range(len(opened.schema_arrow.names)):
            if pa.types.is_floating(opened.schema_arrow.field(at).type):
                continue
            column = opened.read_row_group(number, [opened.schema_arrow.names[at]])
            for values in column.columns:
                search.text("\n".join(map(str, values.unique().to_pylist())).encode())


def _matlab(search: _Search, file: BinaryIO, name: str, depth: int) -> None:
    head = file.read(HEADER)
    order = "little" if head[126:128] == b"IM" else "big"
    while len(element := file.read(ELEMENT)) == ELEMENT:
        kind = int.from_bytes(element[:4], order)  # type: ignore[arg-type] # one of two
        size = int.from_bytes(element[4:], order)  # type: ignore[arg-type]
        end = file.tell() + size
        if kind == COMPRESSED:
            search.unpacked(cast("BinaryIO", _Inflated(file, size)), f"what is in {name}", depth)
        file.seek(end)


class _Inflated:
    """What zlib has packed in the next bytes of a file, as a stream."""

    def __init__(self, file: BinaryIO, size: int) -> None:
        self._file, self._left = file, size
        self._engine = zlib.decompressobj()
        self._rest = b""

    def read(self, size: int) -> bytes:
        """Return up to ``size`` bytes; none at the end."""
        while not self._engine.eof:
            packed = self._rest or self._file.read(min(WINDOW, self._left))
            if not self._rest:
                self._left -= len(packed)
            if not packed:
                raise EOFError("it ends in its middle")
            found = self._engine.decompress(packed, size)
            self._rest = self._engine.unconsumed_tail
            if found:
                return found
        return b""


OPENERS: dict[bytes, _Opener] = {
    b"\x1f\x8b": _stream(lambda file: gzip.GzipFile(fileobj=file, mode="rb")),
    b"\xfd7zXZ\x00": _stream(lzma.open),
    b"BZh": _stream(bz2.open),
    HDF5: _hdf5,
    PARQUET: _parquet,
    MATLAB5: _matlab,
}
"""Functions that open a file, by its first bytes."""
