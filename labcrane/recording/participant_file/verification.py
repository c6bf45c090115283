"""Proof that a participant file holds what it was made of, before anything is replaced by it.

Everything is compared: numbers by their bytes, texts, attributes. Columns that were copied are
compared as they are packed; those of a new session are unpacked, a chunk at a time.
"""

import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from labcrane.recording.foreign_streams import RecordedStream
from labcrane.recording.journal import Column
from labcrane.recording.journal_reader import JournalState, SessionLog
from labcrane.recording.participant_file.columns import (
    ATTRIBUTE_BYTES,
    CHUNK,
    TEXT_CHUNK_BYTES,
    clean,
    holds_texts,
    node_names,
    text_of,
    texts_of,
)
from labcrane.recording.participant_file.session_group import event_columns, write_tables
from labcrane.recording.participant_file.signal_faults import write_signal_faults
from labcrane.recording.participant_file.stream_group import (
    stream_attributes,
    stream_columns,
    write_own_clock,
)
from labcrane.types import FloatArray

if TYPE_CHECKING:
    import h5py

Leave = Callable[[str], bool]
Rename = Callable[[str], str]


def bring_to_disk(path: Path) -> None:
    """Bring a file to the disk, and forget what memory has of it: the disk is read next."""
    with path.open("r+b") as file:  # Windows syncs only what may be written
        os.fsync(file.fileno())
        if sys.platform == "linux":
            os.posix_fadvise(file.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)


def unlike_journals(
    group: "h5py.Group",
    log: SessionLog,
    streams: Sequence[RecordedStream],
    journals: Sequence[JournalState],
) -> Iterator[str]:
    """Yield the differences of a session's group from its journals."""
    yield from _unlike_frames(group, log)
    for name, values, marks in _columns(group, log, streams):
        if name not in group or not _marked(group[name], marks):
            yield name
        elif values is None:
            continue
        elif isinstance(values, str):
            if text_of(group[name]) != clean(values):
                yield name
        elif not (_holds if isinstance(values, np.ndarray) else _holds_texts)(group[name], values):
            yield name
    yield from _unlike_tables(group, log, streams, journals)


def _columns(
    group: "h5py.Group", log: SessionLog, streams: Sequence[RecordedStream]
) -> Iterator[tuple[str, Any, Mapping[str, Any]]]:
    """Yield the expected items: name, values and attributes."""
    yield "time", log.time, {"unit": "s"}
    yield "part", log.part, {"unit": "1"}
    for number, column in enumerate(log.columns):
        yield _path(column), None, {"unit": column.unit, "position": number}
    for name, values in event_columns(log, group).items():
        marks = {"unit": "s" if name == "time" else "1"} if isinstance(values, np.ndarray) else {}
        yield f"events/{name}", values, marks
    names = node_names([stream.header.name for stream in streams])
    for (_, safe), stream in zip(names, streams, strict=True):
        at = f"streams/{safe}"
        yield at, None, stream_attributes(stream)
        yield f"{at}/header", stream.header.xml, {}
        for name, values, unit in stream_columns(stream):
            yield f"{at}/{name}", values, {"unit": unit} if unit else {}
        for number, (label, inside) in enumerate(node_names(list(stream.header.labels))):
            yield f"{at}/data/{inside}", None, {"name": label, "position": number}


def _path(column: Column) -> str:
    return f"{column.group}/{column.label.replace('.', '/')}"


def _marked(node: "h5py.HLObject", marks: Mapping[str, Any]) -> bool:
    """Whether a node has attributes; texts too long for HDF5 do not count."""
    own = _attributes(node)
    return all(
        own.get(name, clean(value)) == clean(value)
        if isinstance(value, str) and len(clean(value).encode()) > ATTRIBUTE_BYTES
        else own.get(name) == (clean(value) if isinstance(value, str) else _told(float(value)))
        for name, value in marks.items()
    )


def _unlike_frames(group: "h5py.Group", log: SessionLog) -> Iterator[str]:
    """Compare sums of all columns: the journal is gone through once, and the file once."""
    from isal.isal_zlib import crc32  # noqa: PLC0415 - who only reads does without

    wanted = [0] * len(log.columns)
    for block in log.blocks():
        for number, values in enumerate(np.ascontiguousarray(block.T)):
            wanted[number] = crc32(values, wanted[number])
    for column, sum_of_it in zip(log.columns, wanted, strict=True):
        name = _path(column)
        if name not in group or group[name].shape != log.time.shape:
            yield name
            continue
        dataset, found = group[name], 0
        for at in range(0, len(dataset), CHUNK):
            found = crc32(dataset[at : at + CHUNK], found)
        if found != sum_of_it:
            yield name


def _holds(dataset: "h5py.Dataset", values: FloatArray) -> bool:
    """Whether a column holds just these values; compared in chunks, to save memory."""
    return dataset.shape == values.shape and all(
        np.array_equal(
            dataset[at : at + CHUNK],
            np.asarray(values[at : at + CHUNK], np.float64),
            equal_nan=True,
        )
        for at in range(0, len(values), CHUNK)
    )


def _holds_texts(dataset: "h5py.Dataset", texts: Sequence[str]) -> bool:
    """Whether a column holds just these texts."""
    if dataset.shape != (len(texts),):
        return False
    step = max(1, TEXT_CHUNK_BYTES // dataset.dtype.itemsize)
    return all(
        dataset[at : at + step].tolist() == [clean(text).encode() for text in texts[at : at + step]]
        for at in range(0, len(texts), step)
    )


def _unlike_tables(
    group: "h5py.Group",
    log: SessionLog,
    streams: Sequence[RecordedStream],
    journals: Sequence[JournalState],
) -> Iterator[str]:
    """Write the small items again, in memory, and compare the two."""
    import h5py  # noqa: PLC0415

    with h5py.File("again", "w", driver="core", backing_store=False) as again:
        write_tables(again, log, journals)
        write_signal_faults(again, log, streams)
        write_own_clock(again, streams)
        own = _attributes(group)
        yield from (
            f"attribute {name}"
            for name, value in _attributes(again).items()
            if own.get(name) != value
        )
        for name in again:
            if name not in group:
                yield name
            else:
                yield from (
                    f"{name}/{each}".removesuffix("/") for each in unlike(again[name], group[name])
                )


def _nothing(_: str) -> bool:
    return False


def unlike(
    old: "h5py.Group | h5py.Dataset",
    new: "h5py.Group | h5py.Dataset",
    leave: Leave = _nothing,
    rename: Rename | None = None,
) -> Iterator[str]:
    """Yield the names of nodes in which a copy is not like what it was copied from.

    Parameters
    ----------
    leave
        Which nodes are not looked at, by their names below ``old``, and attributes, by
        ``node@attribute``.
    rename
        What was done to all texts on the way.
    """
    mine, theirs = dict(_nodes(old, leave)), dict(_nodes(new, leave))
    yield from sorted(set(mine) ^ set(theirs))
    for name in mine.keys() & theirs.keys():
        one, other = mine[name], theirs[name]
        marked = [
            {key: value for key, value in found.items() if not leave(f"{name}@{key}")}
            for found in (_attributes(one, rename), _attributes(other))
        ]
        if marked[0] != marked[1] or not _alike(one, other, rename):
            yield name


def _nodes(
    root: "h5py.Group | h5py.Dataset", leave: Leave
) -> Iterator[tuple[str, "h5py.Group | h5py.Dataset"]]:
    found = [("", root)]
    if hasattr(root, "visititems"):
        root.visititems(lambda name, node: found.append((name, node)))
    yield from ((name, node) for name, node in found if not leave(name))


def _attributes(node: "h5py.HLObject", rename: Rename | None = None) -> dict[str, str]:
    """Return attributes as texts that tell any two values apart."""
    return {
        name: (rename or str)(value) if isinstance(value, str) else _told(value)
        for name, value in node.attrs.items()
    }


def _told(value: object) -> str:
    return repr(np.asarray(value).tolist())


def _alike(
    one: "h5py.Group | h5py.Dataset", other: "h5py.Group | h5py.Dataset", rename: Rename | None
) -> bool:
    import h5py  # noqa: PLC0415

    if not isinstance(one, h5py.Dataset):
        return not isinstance(other, h5py.Dataset)
    if not isinstance(other, h5py.Dataset) or one.shape != other.shape:
        return False
    if rename is not None and holds_texts(one):
        if one.shape == ():
            was, now = one.asstr("utf-8")[()], other.asstr("utf-8")[()]
            return bool(clean(rename(was)) == now)
        return [clean(rename(text)) for text in texts_of(one)] == list(texts_of(other))
    if one.id.get_type() != other.id.get_type() or one.chunks != other.chunks:
        return False
    if one.chunks is None or one.dtype.kind == "O":
        was, now = one[()], other[()]
        if one.dtype.kind == "O":
            return bool(np.asarray(was).tolist() == np.asarray(now).tolist())
        return np.asarray(was).tobytes() == np.asarray(now).tobytes()
    if _packing(one) != _packing(other):
        return False
    places = _chunks(one)
    return places == _chunks(other) and all(
        one.id.read_direct_chunk(at) == other.id.read_direct_chunk(at) for at in places
    )


def _packing(dataset: "h5py.Dataset") -> tuple[object, ...]:
    return dataset.compression, dataset.compression_opts, dataset.shuffle


def _chunks(dataset: "h5py.Dataset") -> list[tuple[int, ...]]:
    """Return where the chunks of a column begin, in order."""
    found: list[tuple[int, ...]] = []
    dataset.id.chunk_iter(lambda chunk: found.append(tuple(chunk.chunk_offset)))
    return sorted(found)
