"""Physio: gaze and other streams of numbers at a steady rate, each as a recording of its own."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from labcrane import FloatArray
from labcrane.analysis import Sampled, eeg_streams, gaze_space, sampled
from labcrane.core import Eye, eyes_of, side_of
from labcrane.recording import LOG, SessionRecord, Stream
from labcrane_bids.files import DEVICE, ROWS, first_tick, stated_facts
from labcrane_bids.settings import BidsSettings

GAZE = "Gaze"
ON_SCREEN = "gaze-on-screen"

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
        if stream.attrs.get("type") != GAZE:
            yield label(stream.name), *_recording(stream, signal, zero, settings)
            continue
        found = eyes_of(stream.header.channels) if stream.header is not None else ()
        for eye in found or (None,):
            eyes += 1
            yield f"eye{eyes}", *_recording(stream, signal, zero, settings, eye, found)


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
    stream: Stream,
    signal: Sampled,
    zero: float,
    settings: BidsSettings,
    eye: Eye | None = None,
    eyes: Sequence[Eye] = (),
) -> tuple[Iterator[list[FloatArray]], dict[str, Any]]:
    """Return samples and description of a stream, or of one of its eyes."""
    names = {} if eye is None else {eye.x: "x_coordinate", eye.y: "y_coordinate"}
    if eye is not None and eye.pupil is not None:
        names[eye.pupil] = "pupil_size"
    others = _others(stream, eye, eyes)
    chosen = [*names, *(column for column in others if column not in names)]
    columns = ["timestamp"]
    for column in chosen:
        name = names.get(column, signal.labels[column])
        while name in columns:
            name += "_recorded"
        columns.append(name)
    about: dict[str, Any] = {
        "SamplingFrequency": signal.measured_hz,
        "StartTime": signal.start - zero,
        "Columns": columns,
        "Description": f"LSL stream {stream.name}",
        "PhysioType": "generic" if eye is None else "eyetrack",  # BIDS has no eyes without a place
        **stated_facts(stream, DEVICE),
    }
    if eye is not None:
        unit = signal.units[eye.x]
        by_unit = SYSTEMS.get(unit.lower()) or SPACES.get(gaze_space(stream))
        about["RecordedEye"] = eye.side or "cyclopean"
        about["SampleCoordinateSystem"] = settings.gaze_system or by_unit or "custom"
        if about["SampleCoordinateSystem"] == "custom":
            said = f"in {unit or 'no stated unit'}; the picture that it refers to is unknown"
            about["SampleCoordinateSystemDescription"] = said
    units = ["s", *(signal.units[column] or "arbitrary" for column in chosen)]
    for name, unit in zip(columns, units, strict=True):
        about[name] = {"Description": name.replace("_", " "), "Units": unit}
    return _samples(signal, zero, chosen), about


def _others(stream: Stream, eye: Eye | None, eyes: Sequence[Eye]) -> list[int]:
    """Return the columns of a stream that are of an eye; those of no eye are of the first."""
    if eye is None or stream.header is None:
        return list(range(len(stream.units)))
    known = {each.side for each in eyes}
    sides = [side_of(channel) for channel in stream.header.channels]
    return [
        column
        for column, side in enumerate(sides)
        if (side if side in known else eyes[0].side) == eye.side
    ]


def _samples(signal: Sampled, zero: float, columns: list[int]) -> Iterator[list[FloatArray]]:
    """Yield time and channels of all rows, a piece at a time; of a missing one the time alone."""
    at = 0
    for piece in signal.pieces(ROWS):
        time = np.interp(np.arange(at, at + len(piece)), signal.rows, signal.time)
        yield [time - zero, *piece.T[columns]]
        at += len(piece)
