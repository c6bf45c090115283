"""Physio: gaze and other streams of numbers at a rate, each as a recording of its own."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from labcrane.analysis import eeg_streams
from labcrane.recording import SessionRecord, Stream
from labcrane_bids.files import MISSING, label
from labcrane_bids.settings import BidsSettings

if TYPE_CHECKING:
    import pandas as pd

GAZE = "Gaze"
KNOWN = {
    "x": "x_coordinate",
    "y": "y_coordinate",
    "pupil": "pupil_size",
    "pupil_size": "pupil_size",
}
"""Channels of gaze that BIDS has names for; others keep their labels."""

SYSTEMS = {
    "m": "gaze-in-world", "cm": "gaze-in-world", "mm": "gaze-in-world", "meters": "gaze-in-world",
    "pixel": "gaze-on-screen", "pixels": "gaze-on-screen", "px": "gaze-on-screen",
    "normalized": "gaze-on-screen", "rad": "eye-in-head", "deg": "eye-in-head",
    "degrees": "eye-in-head",
}  # fmt: skip
"""Coordinate system of gaze, by the unit of its x: what is in metres is in the world."""


def continuous_recordings(
    session: SessionRecord, settings: BidsSettings
) -> Iterator[tuple[str, "pd.DataFrame", dict[str, Any]]]:
    """Yield recording label, samples and description of each stream that is no EEG."""
    zero = session.streams["state"].time[0]
    eyes = 0
    for stream in _others(session):
        gaze = stream.attrs.get("type") == GAZE
        if _is_text(stream) or (not gaze and not _rate(stream)):
            continue
        eyes += gaze
        name = f"eye{eyes}" if gaze else label(stream.name)
        yield name, *_recording(stream, zero, settings, gaze=gaze)


def left_out(session: SessionRecord) -> list[str]:
    """Return the streams that are written nowhere."""
    return [
        stream.name
        for stream in _others(session)
        if _is_text(stream) or (stream.attrs.get("type") != GAZE and not _rate(stream))
    ]


def _others(session: SessionRecord) -> list[Stream]:
    brains = {stream.name for stream in eeg_streams(session)}
    return [
        stream
        for name, stream in session.streams.items()
        if "corrected" in stream.attrs and name not in brains
    ]


def _is_text(stream: Stream) -> bool:
    return stream.attrs.get("format") == "string"


def _rate(stream: Stream) -> float:
    return float(stream.attrs.get("rate_hz", 0.0))


def _recording(
    stream: Stream, zero: float, settings: BidsSettings, *, gaze: bool
) -> tuple["pd.DataFrame", dict[str, Any]]:
    numbers = stream.data.select_dtypes("number")
    labels = [str(name) for name in numbers]
    called = [KNOWN.get(name, name) for name in labels] if gaze else labels
    samples = numbers.set_axis(called, axis=1)
    samples.insert(0, "timestamp", stream.time - zero)
    rate_hz = _rate(stream)
    if rate_hz == 0.0 and len(stream.time) > 1:
        rate_hz = float(1.0 / np.median(np.diff(stream.time)))
    columns = list(map(str, samples))
    about: dict[str, Any] = {
        "SamplingFrequency": rate_hz,
        "StartTime": float(samples["timestamp"].iloc[0]) if len(samples) else 0.0,
        "Columns": columns,
        "PhysioType": "eyetrack" if gaze else "generic",
        "Manufacturer": str(stream.attrs.get("source_id", MISSING)) or MISSING,
    }
    if gaze:
        unit = stream.units.get("x", "").lower()
        about["RecordedEye"] = "cyclopean"
        about["SampleCoordinateSystem"] = settings.gaze_system or SYSTEMS.get(unit) or MISSING
    units = ["s", *(stream.units[name] or "arbitrary" for name in labels)]
    for column, unit in zip(columns, units, strict=True):
        about[column] = {"Description": column.replace("_", " "), "Units": unit}
    return samples, about
