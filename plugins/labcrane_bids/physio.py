"""Physio: gaze and other streams of numbers at a rate, each as a recording of its own."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from labcrane import FloatArray
from labcrane.analysis import eeg_streams, gaze_space
from labcrane.recording import SessionRecord, Stream
from labcrane_bids.files import MISSING, ROWS, first_tick
from labcrane_bids.settings import BidsSettings

GAZE = "Gaze"
ON_SCREEN = "gaze-on-screen"
PUPIL = {"pupil": "pupil_size", "pupil_size": "pupil_size"}
"""Other channels of gaze for which BIDS has names; all others keep their labels."""

SYSTEMS = {
    "m": "gaze-in-world", "cm": "gaze-in-world", "mm": "gaze-in-world", "meters": "gaze-in-world",
    "rad": "eye-in-head", "deg": "eye-in-head", "degrees": "eye-in-head",
}  # fmt: skip
"""Coordinate system of gaze by the unit of x; metres mean world coordinates."""

SPACES = {"screen": ON_SCREEN, "scene": "eye-in-head"}
"""Coordinate system of pixels and shares of a picture, by whose picture it is: a scene camera moves
with the head."""


def continuous_recordings(
    session: SessionRecord, settings: BidsSettings, label: Callable[[str], str]
) -> Iterator[tuple[str, Iterator[list[FloatArray]], dict[str, Any]]]:
    """Yield recording label, samples and description of each stream except EEG."""
    zero = first_tick(session)
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
) -> tuple[Iterator[list[FloatArray]], dict[str, Any]]:
    place = _place(stream.numeric) if gaze else ()
    labels = [*place, *(name for name in stream.numeric if name not in place)]
    names = dict(zip(place, ("x_coordinate", "y_coordinate"), strict=False)) | PUPIL if gaze else {}
    called = [names.get(name, name) for name in labels]
    rate_hz = _rate(stream)
    if rate_hz == 0.0 and len(stream) > 1:
        rate_hz = float(1.0 / np.median(np.diff(stream.column("time"))))
    columns = ["timestamp", *called]
    about: dict[str, Any] = {
        "SamplingFrequency": rate_hz,
        "StartTime": float(stream.column("time", 0, 1)[0] - zero) if len(stream) else 0.0,
        "Columns": columns,
        "Description": f"LSL stream {stream.name}",
        "PhysioType": "eyetrack" if place else "generic",  # BIDS has no eyes without a place
        "Manufacturer": str(stream.attrs.get("source_id", MISSING)) or MISSING,
    }
    if place:
        unit = stream.units[place[0]]
        by_unit = SYSTEMS.get(unit.lower()) or SPACES.get(gaze_space(stream))
        about["RecordedEye"] = "cyclopean"
        about["SampleCoordinateSystem"] = settings.gaze_system or by_unit or "custom"
        if about["SampleCoordinateSystem"] == "custom":
            said = f"in {unit or 'no stated unit'}; the picture that it refers to is unknown"
            about["SampleCoordinateSystemDescription"] = said
    units = ["s", *(stream.units[name] or "arbitrary" for name in labels)]
    for column, unit in zip(columns, units, strict=True):
        about[column] = {"Description": column.replace("_", " "), "Units": unit}
    return _samples(stream, zero, labels), about


def _place(labels: Sequence[str]) -> tuple[str, ...]:
    """Return the first x that has its y: ``x`` and ``y``, ``Gaze X`` and ``Gaze Y``."""
    for name in labels:
        other = name[:-1] + {"x": "y", "X": "Y"}.get(name[-1:], "")
        if other in labels and other != name[:-1]:
            return name, other
    return ()


def _samples(stream: Stream, zero: float, labels: list[str]) -> Iterator[list[FloatArray]]:
    """Yield time and channels, a piece at a time."""
    for at in range(0, len(stream), ROWS):
        values = stream.values(labels, at, at + ROWS)
        yield [stream.column("time", at, at + ROWS) - zero, *values.values()]
