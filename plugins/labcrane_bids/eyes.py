"""Eye tracking: each gaze stream as a physio recording."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from labcrane.recording import SessionRecord, Stream

if TYPE_CHECKING:
    import pandas as pd

KIND = "Gaze"
KNOWN = {
    "x": "x_coordinate",
    "y": "y_coordinate",
    "pupil": "pupil_size",
    "pupil_size": "pupil_size",
}
"""Channels BIDS has names for; others keep their labels."""


def eye_recordings(
    session: SessionRecord,
) -> Iterator[tuple[str, "pd.DataFrame", dict[str, Any]]]:
    """Yield recording label, samples and description of each gaze stream."""
    zero = session.streams["state"].time[0]
    gazes = [s for s in session.streams.values() if s.attrs.get("type") == KIND]
    for number, stream in enumerate(gazes, start=1):
        yield f"eye{number}", *_recording(stream, zero)


def _recording(stream: Stream, zero: float) -> tuple["pd.DataFrame", dict[str, Any]]:
    numbers = stream.data.select_dtypes("number")
    labels = [str(name) for name in numbers]
    samples = numbers.set_axis([KNOWN.get(name, name) for name in labels], axis=1)
    samples.insert(0, "timestamp", stream.time - zero)
    rate_hz = float(stream.attrs.get("rate_hz", 0.0))
    if rate_hz == 0.0 and len(stream.time) > 1:
        rate_hz = float(1.0 / np.median(np.diff(stream.time)))
    columns = list(map(str, samples))
    about: dict[str, Any] = {
        "SamplingFrequency": rate_hz,
        "StartTime": float(samples["timestamp"].iloc[0]) if len(samples) else 0.0,
        "Columns": columns,
        "PhysioType": "eyetrack",
        "RecordedEye": "cyclopean",
        "SampleCoordinateSystem": "gaze-in-world",
        "Manufacturer": str(stream.attrs.get("source_id", "n/a")) or "n/a",
    }
    units = ["s", *(stream.units[name] or "arbitrary" for name in labels)]
    for column, unit in zip(columns, units, strict=True):
        about[column] = {"Description": column.replace("_", " "), "Units": unit}
    return samples, about
