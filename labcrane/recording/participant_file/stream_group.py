"""Writes the streams of others into a session of a participant file."""

import json
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from labcrane.errors import LabcraneError, RecordingError
from labcrane.recording.foreign_streams import PROBE_CHANNELS, Correct, RecordedStream
from labcrane.recording.participant_file.columns import (
    node_names,
    write_attributes,
    write_numbers,
    write_text,
    write_texts,
)

if TYPE_CHECKING:
    import h5py


def write_streams(
    group: "h5py.Group", streams: Sequence[RecordedStream], correct: Correct | None
) -> None:
    """Write all streams; those without a sample as well, so that nobody misses them silently."""
    if not streams:
        return
    all_streams = group.create_group("streams")
    names = node_names([stream.header.name for stream in streams])
    for (_, safe), stream in zip(names, streams, strict=True):
        _write_stream(all_streams.create_group(safe), stream, correct)


def _write_stream(group: "h5py.Group", stream: RecordedStream, correct: Correct | None) -> None:
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
    if correct is not None:
        write_time(group, stream, correct)
    _write_beside(group, stream)
    _write_data(group.create_group("data"), stream)


def write_time(group: "h5py.Group", stream: RecordedStream, correct: Correct) -> None:
    """Write a stream's corrected times and how right they are, or why there are none."""
    try:
        correction = correct(stream)
    except LabcraneError as error:  # one stream's clock must not keep a session from its file
        write_attributes(group, {"uncorrected": str(error)})
        return
    if correction.time.shape != stream.time_raw.shape:
        raise RecordingError(
            f"the correction of stream {stream.header.name!r} returned {len(correction.time)} "
            f"times for {len(stream.time_raw)} samples"
        )
    write_numbers(group, "time", correction.time, "s")
    write_attributes(group["time"], correction.quality)


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
