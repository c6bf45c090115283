"""Physio: gaze and other streams of numbers at a steady rate, each as a recording of its own."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from labcrane import FloatArray
from labcrane.analysis import Sampled, eeg_streams, gaze_space, sampled
from labcrane.recording import LOG, SessionRecord, Stream
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


UNSTEADY = "no steady rate"

STEADY_S = 0.01
"""Seconds by which a time by rate and start may miss a sample's own."""

RESTARTED = 0.6
"""Sample periods by which it may do so where a source states its rate: when a source starts again,
its samples are at other fractions of a period."""


def continuous_recordings(
    session: SessionRecord,
    settings: BidsSettings,
    label: Callable[[str], str],
    left_out: Counter[tuple[str, str]],
) -> Iterator[tuple[str, Iterator[list[FloatArray]], dict[str, Any]]]:
    """Yield recording label, samples and description of each stream except EEG.

    Parameters
    ----------
    left_out
        Streams that are written nowhere, and the reason: each is counted.
    """
    zero = first_tick(session)
    brains = {stream.name for stream in eeg_streams(session)}
    eyes = 0
    for stream in session.streams.values():
        if "corrected" not in stream.attrs or stream.name in brains:
            continue
        why = _unsampled(stream)
        signal = None if why else sampled(stream)
        if signal is None or not _is_steady(signal, stream):
            left_out[stream.name, why or UNSTEADY] += 1
            continue
        gaze = stream.attrs.get("type") == GAZE
        eyes += gaze
        name = f"eye{eyes}" if gaze else label(stream.name)
        yield name, *_recording(stream, signal, zero, settings, gaze=gaze)


def _unsampled(stream: Stream) -> str:
    """Return why a stream is not a sampled signal; empty if it may be one."""
    if stream.name.startswith(LOG):
        return "a log of labcrane"
    if len(stream.numeric) != len(stream.units):
        return "texts"
    if not stream.attrs["corrected"]:
        return "its clock was not corrected"
    times = stream.column("time")
    return UNSTEADY if len(times) == 0 or times.min() == times.max() else ""


def _is_steady(signal: Sampled, stream: Stream) -> bool:
    """Return whether rate and start give the times of the samples."""
    stated = stream.header is not None and stream.header.rate_hz > 0.0
    return signal.off_s() <= max(STEADY_S, RESTARTED / signal.measured_hz if stated else 0.0)


def _recording(
    stream: Stream, signal: Sampled, zero: float, settings: BidsSettings, *, gaze: bool
) -> tuple[Iterator[list[FloatArray]], dict[str, Any]]:
    place = _place(stream.numeric) if gaze else ()
    labels = [*place, *(name for name in stream.numeric if name not in place)]
    names = dict(zip(place, ("x_coordinate", "y_coordinate"), strict=False)) | PUPIL if gaze else {}
    called = [names.get(name, name) for name in labels]
    columns = ["timestamp", *called]
    about: dict[str, Any] = {
        "SamplingFrequency": signal.measured_hz,
        "StartTime": signal.start - zero,
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
    return _samples(signal, zero, labels), about


def _place(labels: Sequence[str]) -> tuple[str, ...]:
    """Return the first x that has its y: ``x`` and ``y``, ``Gaze X`` and ``Gaze Y``."""
    for name in labels:
        other = name[:-1] + {"x": "y", "X": "Y"}.get(name[-1:], "")
        if other in labels and other != name[:-1]:
            return name, other
    return ()


def _samples(signal: Sampled, zero: float, labels: list[str]) -> Iterator[list[FloatArray]]:
    """Yield time and channels of all rows, a piece at a time; of a missing one the time alone."""
    order = [signal.labels.index(name) for name in labels]
    at = 0
    for piece in signal.pieces(ROWS):
        time = np.interp(np.arange(at, at + len(piece)), signal.rows, signal.time)
        yield [time - zero, *piece.T[order]]
        at += len(piece)
