"""Groups of the streams of others in a session of a participant file, written."""

import json
from collections.abc import Mapping, Sequence
from functools import reduce
from typing import TYPE_CHECKING

import numpy as np

from labcrane.errors import RecordingError
from labcrane.recording.foreign_streams import (
    OWN_CLOCK_CHANNELS,
    PROBE_CHANNELS,
    RecordedStream,
    both_clocks,
)
from labcrane.recording.participant_file.columns import (
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
"""What stands beside a stream's raw stamps once it is corrected, with units: when a sample was, on
our clock; how far that may be off at 95 %; the same without evening; and what it rests on, a place
in :data:`BASES`."""

BASES = ("probes", "arrivals", "nothing")


def write_streams(group: "h5py.Group", streams: Sequence[RecordedStream]) -> None:
    """Write all streams; those without a sample as well, so that nobody misses them silently."""
    if not streams:
        return
    all_streams = group.create_group("streams")
    names = node_names([stream.header.name for stream in streams])
    for (_, safe), stream in zip(names, streams, strict=True):
        _write_stream(all_streams.create_group(safe), stream)
    clocks = reduce(both_clocks, (stream.own_clock for stream in streams))
    for column, channel in enumerate(OWN_CLOCK_CHANNELS if len(clocks) else ()):
        write_numbers(group, f"own_clock/{channel.label}", clocks[:, column], channel.unit)


def _write_stream(group: "h5py.Group", stream: RecordedStream) -> None:
    header = stream.header
    write_attributes(
        group,
        {
            "name": header.name,
            "type": header.type,
            "source_id": header.source_id,
            "rate_hz": float(header.rate_hz),
            "format": header.format,
        },
    )
    write_text(group, "header", header.xml)
    write_numbers(group, "time_raw", stream.time_raw, "s")
    write_numbers(group, "starts", np.array(stream.starts, np.float64), "1")
    _write_beside(group, stream)
    _write_data(group.create_group("data"), stream)


def write_time(
    group: "h5py.Group", columns: Mapping[str, FloatArray], quality: Mapping[str, float | str]
) -> None:
    """Write a stream's corrected times, and beside them how right they are.

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


def _write_beside(group: "h5py.Group", stream: RecordedStream) -> None:
    for number, channel in enumerate(PROBE_CHANNELS):
        write_numbers(group, f"clock/{channel.label}", stream.probes[:, number], "s")
    write_numbers(group, "arrival/count", stream.arrivals[:, 0], "1")
    write_numbers(group, "arrival/time", stream.arrivals[:, 1], "s")
    write_numbers(group, "notes/time", np.array([note.time for note in stream.notes]), "s")
    write_texts(
        group,
        "notes/data",
        [json.dumps(dict(note.data), ensure_ascii=False) for note in stream.notes],
    )
    if len(stream.offsets):
        write_numbers(group, "offsets/time", stream.offsets[:, 0], "s")
        write_numbers(group, "offsets/value", stream.offsets[:, 1], "s")


def _write_data(group: "h5py.Group", stream: RecordedStream) -> None:
    names = node_names(list(stream.header.labels))
    for number, ((label, safe), channel) in enumerate(
        zip(names, stream.header.channels, strict=True)
    ):
        if stream.header.dtype is None:
            write_texts(group, safe, [row[number] for row in stream.texts])
        else:
            write_numbers(group, safe, stream.data[:, number].astype(np.float64), channel.unit)
        write_attributes(group[safe], {"name": label, "position": number})
