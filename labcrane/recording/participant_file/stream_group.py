"""Writing of the groups of external streams in a session of a participant file."""

import json
from collections.abc import Iterator, Mapping, Sequence
from functools import reduce
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from labcrane.errors import RecordingError
from labcrane.recording.foreign_streams import (
    OWN_CLOCK_CHANNELS,
    PROBE_CHANNELS,
    RecordedStream,
    both_clocks,
)
from labcrane.recording.participant_file.columns import (
    EXACT,
    node_names,
    write_attributes,
    write_numbers,
    write_text,
    write_texts,
)
from labcrane.types import FloatArray

if TYPE_CHECKING:
    import h5py

TIME_COLUMNS = {"time": "s", "time_error": "s", "time_uneven": "s", "time_basis": "1"}
"""Columns next to a stream's raw timestamps once it is corrected, with units: the time of a sample
on the recorder's clock; its uncertainty at 95 %; the time before dejittering; and the basis of the
time, an index into :data:`BASES`."""

BASES = ("probes", "arrivals", "nothing")


def write_streams(group: "h5py.Group", streams: Sequence[RecordedStream]) -> None:
    """Write all streams, also those without a sample, so that none is missing unnoticed."""
    if not streams:
        return
    all_streams = group.create_group("streams")
    names = node_names([stream.header.name for stream in streams])
    for (_, safe), stream in zip(names, streams, strict=True):
        _write_stream(all_streams.create_group(safe), stream)
    write_own_clock(group, streams)


def write_own_clock(group: "h5py.Group", streams: Sequence[RecordedStream]) -> None:
    """Write the log that the session's recorders kept of their own clock."""
    if not streams:
        return
    clocks = reduce(both_clocks, (stream.own_clock for stream in streams))
    for column, channel in enumerate(OWN_CLOCK_CHANNELS if len(clocks) else ()):
        write_numbers(group, f"own_clock/{channel.label}", clocks[:, column], channel.unit)


def _write_stream(group: "h5py.Group", stream: RecordedStream) -> None:
    header = stream.header
    write_attributes(group, stream_attributes(stream))
    write_text(group, "header", header.xml)
    group.create_group("data")
    for name, values, unit in stream_columns(stream):
        if isinstance(values, np.ndarray):
            write_numbers(group, name, values, unit, whole=values.dtype == np.int64)
        else:
            write_texts(group, name, values)
    for number, (label, safe) in enumerate(node_names(list(header.labels))):
        write_attributes(group[f"data/{safe}"], {"name": label, "position": number})


def stream_attributes(stream: RecordedStream) -> dict[str, str | float]:
    """Return the attributes of a stream's group, from its header."""
    header = stream.header
    return {
        "name": header.name,
        "type": header.type,
        "source_id": header.source_id,
        "rate_hz": float(header.rate_hz),
        "format": header.format,
    }


def stream_columns(
    stream: RecordedStream,
) -> Iterator[tuple[str, npt.NDArray[Any] | Sequence[str], str]]:
    """Yield name, values and unit of each column of a stream, as its recorder had them."""
    yield "time_raw", stream.time_raw, "s"
    yield "starts", np.array(stream.starts, np.float64), "1"
    for number, channel in enumerate(PROBE_CHANNELS):
        yield f"clock/{channel.label}", stream.probes[:, number], "s"
    yield "arrival/count", stream.arrivals[:, 0], "1"
    yield "arrival/time", stream.arrivals[:, 1], "s"
    yield "notes/time", np.array([note.time for note in stream.notes]), "s"
    told = [json.dumps(dict(note.data), ensure_ascii=False) for note in stream.notes]
    yield "notes/data", told, ""
    if len(stream.offsets):
        yield "offsets/time", stream.offsets[:, 0], "s"
        yield "offsets/value", stream.offsets[:, 1], "s"
    names = node_names(list(stream.header.labels))
    for number, ((_, safe), channel) in enumerate(zip(names, stream.header.channels, strict=True)):
        if stream.header.dtype is None:
            yield f"data/{safe}", [row[number] for row in stream.texts], ""
        else:
            values: npt.NDArray[Any] = stream.data[:, number]
            # Only what float64 would round: R reads it without being asked, and int64 not.
            if values.dtype != np.int64 or not ((values < -EXACT) | (values > EXACT)).any():
                values = values.astype(np.float64)
            yield f"data/{safe}", values, channel.unit


def write_time(
    group: "h5py.Group", columns: Mapping[str, FloatArray], quality: Mapping[str, float | str]
) -> None:
    """Write a stream's corrected times, with their uncertainty.

    Times that were there before are kept below ``earlier``, oldest first, unless they are the same.

    Parameters
    ----------
    group
        The stream's.
    columns
        Of :data:`TIME_COLUMNS`, one number per sample.
    quality
        Figures and texts by name, kept as attributes of the time.
    """
    count = len(group["time_raw"])
    for name, values in columns.items():
        if values.shape != (count,):
            raise RecordingError(
                f"{name} of stream {group.attrs['name']!r} has {len(values)} numbers for {count} "
                "samples"
            )
    _put_aside(group, columns["time"])
    group.attrs.pop("uncorrected", None)
    for name, values in columns.items():
        write_numbers(group, name, values, TIME_COLUMNS[name])
    write_attributes(group["time"], quality)


def write_uncorrected(group: "h5py.Group", reason: str) -> None:
    """Write why a stream has no corrected times; it has no earlier ones then either."""
    _put_aside(group, None)
    write_attributes(group, {"uncorrected": reason})


def _put_aside(group: "h5py.Group", time: FloatArray | None) -> None:
    """Make room for new times, and keep the old ones if they were others."""
    if "time" not in group:
        return
    if time is None or not np.array_equal(group["time"][:], time, equal_nan=True):
        earlier = group.require_group("earlier")
        group.move("time", f"earlier/time-{len(earlier) + 1}")
    for name in TIME_COLUMNS:
        if name in group:
            del group[name]
