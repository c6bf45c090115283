"""Columns in HDF5 that R, MATLAB and Octave read alike.

Numbers are one-dimensional float64 columns, everything else is UTF-8 text. No int64 (R turns it
into NA) but for channels of streams that float64 would round, no truth values, no compound types,
no variable-length arrays but texts.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    import h5py

EXACT = 2**53
"""Whole numbers beyond this are not exact in float64, and are written as text."""

GZIP_LEVEL = 1  # 4 takes twice as long and saves 2 to 4 % of shuffled float64
CHUNK = 1 << 16
TEXT_CHUNK_BYTES = 1 << 20
COMPRESS_FROM = 64
"""Shorter columns are stored as they are: compressed chunks would be larger."""

ATTRIBUTE_BYTES = 60_000
"""HDF5 refuses attributes beyond 64 kB."""


def write_numbers(
    group: "h5py.Group", path: str, values: npt.NDArray[Any], unit: str, *, whole: bool = False
) -> None:
    """Write one column of numbers with its unit; ``whole`` ones are kept as int64."""
    values = np.ascontiguousarray(values, np.int64 if whole else np.float64)
    if len(values) < COMPRESS_FROM:
        dataset = group.create_dataset(path, data=values)
    else:
        dataset = group.create_dataset(
            path,
            data=values,
            chunks=(min(len(values), CHUNK),),
            compression="gzip",
            compression_opts=GZIP_LEVEL,
            shuffle=True,
        )
    write_attributes(dataset, {"unit": unit})


def write_texts(group: "h5py.Group", path: str, texts: Sequence[str]) -> None:
    """Write one column of texts, as UTF-8 bytes of one length.

    Octave 7 loads no file with texts of variable length, nor with texts marked as UTF-8: it has no
    conversion for either, and gives up on the whole file.
    """
    values = np.array([clean(text).encode() for text in texts], np.bytes_)
    if len(values) < COMPRESS_FROM:
        group.create_dataset(path, data=values)
    else:
        group.create_dataset(
            path,
            data=values,
            chunks=(max(1, min(len(values), TEXT_CHUNK_BYTES // values.itemsize)),),
            compression="gzip",
            compression_opts=GZIP_LEVEL,
        )


def write_text(group: "h5py.Group", path: str, text: str) -> None:
    """Write one text."""
    group.create_dataset(path, data=np.bytes_(clean(text).encode()))


def holds_texts(dataset: "h5py.Dataset") -> bool:
    """Whether a column holds texts, of one length or, from older files, of their own."""
    return dataset.dtype.kind in "OS"


def texts_of(dataset: "h5py.Dataset") -> npt.NDArray[np.object_]:
    """Return a column of texts.

    Chunk by chunk: all texts have the length of the longest, so that thousands of short events
    beside a long one would need hundreds of megabytes.
    """
    if dataset.chunks is None or not len(dataset):
        return np.asarray(dataset.asstr("utf-8")[:], object)
    texts = dataset.asstr("utf-8")
    return np.concatenate([np.asarray(texts[part], object) for part in dataset.iter_chunks()])


def text_of(dataset: "h5py.Dataset") -> str:
    """Return one text."""
    return str(dataset.asstr("utf-8")[()])


def write_values(group: "h5py.Group", path: str, values: Sequence[Any], unit: str | None) -> None:
    """Write one column of whatever JSON holds: numbers if all are, texts otherwise.

    Truth values become 1 and 0; what is missing becomes NaN, or an empty text.
    """
    if all(_is_number(value) for value in values):
        numbers = np.array([np.nan if value is None else float(value) for value in values])
        write_numbers(group, path, numbers, unit or "1")
    else:
        write_texts(group, path, [as_text(value) for value in values])


def write_attributes(node: "h5py.HLObject", values: Mapping[str, Any]) -> None:
    """Write numbers and texts as attributes; truth values become yes and no."""
    for name, value in values.items():
        if isinstance(value, bool):
            node.attrs[name] = "yes" if value else "no"
        elif value is not None and _is_number(value):
            node.attrs[name] = float(value)
        else:
            text = clean(as_text(value))
            if len(text.encode()) <= ATTRIBUTE_BYTES:
                node.attrs[name] = text


def _is_number(value: object) -> bool:
    if isinstance(value, int):
        return abs(value) <= EXACT
    return value is None or isinstance(value, float)


def as_text(value: object) -> str:
    """Return a value as text: texts as they are, nothing as "", everything else as JSON."""
    if value is None:
        return ""
    return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)


def clean(text: str) -> str:
    """Return a text that HDF5 can hold: no NUL, no half surrogates."""
    return text.replace("\0", "␀").encode(errors="replace").decode()


def node_names(names: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield each name with one that can be a name in HDF5, all different."""
    taken = set()
    for name in names:
        safe = clean(name).replace("/", "_").strip(".") or "_"
        number, chosen = 1, safe
        while chosen in taken:
            number += 1
            chosen = f"{safe}-{number}"
        taken.add(chosen)
        yield name, chosen
