"""Proof by what a file says, packed as it may be: a zipped workbook shows no name to a search."""

import gzip
import io
import lzma
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from labcrane.participants.mentions import Mentions

DEEPEST = 4
"""Archives in archives that are opened."""

LARGEST = 2**31
"""Bytes that are unpacked of one member; more is somebody's trap."""

HDF5, PARQUET, MATLAB5 = b"\x89HDF\r\n\x1a\n", b"PAR1", b"MATLAB 5.0"
ELEMENT, HEADER = 8, 128
COMPRESSED = 15
"""Type of an element of a MAT file that zlib has packed."""


def mentioned(path: Path, mentions: Mentions) -> set[str]:
    """Return whose pseudonyms are in what a file holds; its name is not looked at."""
    found: set[str] = set()
    for content in contents(path):
        found |= mentions.of(content.decode("latin-1"))
        # MAT files and Windows programs write two bytes a letter.
        if b"\x00" in content:
            found |= mentions.of(content[::2].decode("latin-1"))
            found |= mentions.of(content[1::2].decode("latin-1"))
    return found


def contents(path: Path) -> Iterator[bytes]:
    """Yield everything that can be read in a file: its bytes, and whatever is packed in them.

    Zip (and so workbooks), gzip, xz, HDF5, Parquet and MAT are opened. Text that was drawn into a
    picture is not found.
    """
    yield from _contents(path.read_bytes(), DEEPEST)


def _contents(content: bytes, depth: int) -> Iterator[bytes]:
    yield content
    if depth == 0:
        return
    for inner in _unpacked(content):
        yield from _contents(inner, depth - 1)


def _unpacked(content: bytes) -> Iterator[bytes]:
    try:
        if content[:2] == b"\x1f\x8b":
            yield gzip.GzipFile(fileobj=io.BytesIO(content)).read(LARGEST)
        elif content[:6] == b"\xfd7zXZ\x00":
            yield lzma.decompress(content)
        elif zipfile.is_zipfile(io.BytesIO(content)):
            with zipfile.ZipFile(io.BytesIO(content)) as archive:
                for member in archive.infolist():
                    yield member.filename.encode()
                    with archive.open(member) as file:
                        yield file.read(LARGEST)
        elif content.startswith(HDF5):
            yield from _hdf5(content)
        elif content.startswith(PARQUET):
            yield from _parquet(content)
        elif content.startswith(MATLAB5):
            yield from _matlab(content)
    except (
        OSError,
        EOFError,
        ValueError,
        zipfile.BadZipFile,
        zlib.error,
        lzma.LZMAError,
        KeyError,
    ):
        return  # damaged, or only looks like one: its bytes have been searched


def _hdf5(content: bytes) -> Iterator[bytes]:
    import h5py  # noqa: PLC0415 - loads for a second

    found: list[bytes] = []

    def look(name: str, node: Any) -> None:
        found.append(name.encode())
        found.extend(f"{key} {value}".encode() for key, value in node.attrs.items())
        if isinstance(node, h5py.Dataset) and node.dtype.kind in "OSUV" and node.dtype != "V":
            found.append(_as_bytes(node[()]))

    # Links to other files are not followed: visititems leaves them out.
    with h5py.File(io.BytesIO(content), "r") as file:
        found.extend(f"{key} {value}".encode() for key, value in file.attrs.items())
        file.visititems(look)
    yield from found


def _as_bytes(value: Any) -> bytes:
    import numpy as np  # noqa: PLC0415

    if isinstance(value, bytes):
        return value
    if isinstance(value, str):
        return value.encode()
    array = np.asarray(value)
    if array.dtype.kind == "O":
        return b"\n".join(_as_bytes(each) for each in array.ravel().tolist())
    return array.tobytes()


def _parquet(content: bytes) -> Iterator[bytes]:
    import pyarrow as pa  # noqa: PLC0415 - loads for a second
    from pyarrow import parquet  # noqa: PLC0415

    try:
        file = parquet.ParquetFile(io.BytesIO(content))
        yield str(file.schema_arrow.metadata).encode()
        for number in range(file.num_row_groups):
            table = file.read_row_group(number)
            for column in table.columns:
                if not pa.types.is_floating(column.type):
                    yield "\n".join(map(str, column.unique().to_pylist())).encode()
    except pa.ArrowException:
        return


def _matlab(content: bytes) -> Iterator[bytes]:
    order = "little" if content[126:128] == b"IM" else "big"
    at = HEADER
    while at + ELEMENT <= len(content):
        kind = int.from_bytes(content[at : at + 4], order)  # type: ignore[arg-type] # one of two
        size = int.from_bytes(content[at + 4 : at + 8], order)  # type: ignore[arg-type]
        at += ELEMENT
        if kind == COMPRESSED:
            yield zlib.decompress(content[at : at + size])
        at += size
