"""Sampled signal: a stream as consecutive samples, and the sample of each time."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from labcrane.errors import RecordingError
from labcrane.recording.participant_file.columns import CHUNK
from labcrane.recording.participant_file.reader import Stream
from labcrane.types import FloatArray

NOMINAL = 1e-3
"""Tolerated relative error of a source's stated rate: clocks differ by 1e-4 at most."""

LOST = 1.5
"""Sample periods between two samples from which on some between them are missing."""

EVEN = 0.2
"""Share by which the usual step of dejittered timestamps may miss a period."""

SILENT_S = 1.0
"""Seconds without a sample from which on some are missing although timestamps come in bursts."""


@dataclass(frozen=True)
class Sampled:
    """A stream of numbers at a steady rate.

    The samples are as they were recorded, none is interpolated. For any behaviour of the
    source's clock and any missing samples, :meth:`at` gives the sample of a session's time.

    Attributes
    ----------
    labels, kinds, units
        Of each channel; a kind or a unit that the source does not state is empty.
    rate_hz
        Samples per second: what the source states, or what was measured where it states none, or
        one that is off by more than a thousandth.
    time
        Of each sample, in seconds on the session's clock, shape ``(n,)``.
    gaps
        Numbers of the samples before which some are missing, shape ``(n_gaps,)``.
    """

    labels: tuple[str, ...]
    kinds: tuple[str, ...]
    units: tuple[str, ...]
    rate_hz: float
    time: FloatArray
    gaps: npt.NDArray[np.intp]
    _stream: Stream

    @cached_property
    def data(self) -> FloatArray:
        """All samples in the channels' units, shape ``(n, n_channels)``, kept in memory."""
        return np.concatenate([np.empty((0, len(self.labels))), *self.pieces()])

    def pieces(self, rows: int = CHUNK) -> Iterator[FloatArray]:
        """Yield :attr:`data` by at most so many samples, which are read from the file then."""
        for at in range(0, len(self.time), rows):
            values = self._stream.values(self.labels, at, at + rows)
            yield np.column_stack([values[name] for name in self.labels]).astype(np.float64)

    def at(self, times: FloatArray) -> FloatArray:
        """Return the samples of times, counted from 0, with fractions.

        Parameters
        ----------
        times
            In seconds on the session's clock, shape ``(n_times,)``.

        Returns
        -------
        FloatArray
            Shape ``(n_times,)``, in samples; NaN before the first and after the last.
        """
        numbers = np.arange(len(self.time), dtype=np.float64)
        half = 0.5 / self.rate_hz  # what happened just before the first is at the first
        inside = (times >= self.time[0] - half) & (times <= self.time[-1] + half)
        return np.where(inside, np.interp(times, self.time, numbers), np.nan)


def sampled(stream: Stream) -> Sampled:
    """Return a stream of numbers as samples at a steady rate.

    Raises
    ------
    RecordingError
        It contains texts, has fewer than two samples, or its clock was not corrected.
    """
    header = stream.header
    if header is None or not stream.attrs["corrected"]:
        raise RecordingError(
            f"stream {stream.name!r} is one of the session's own, or its clock was not corrected, "
            "so its samples have no times on the session's clock; run labcrane resync to try again"
        )
    numeric, count = stream.numeric, len(stream)
    if len(numeric) != len(stream.units) or count < 2:  # noqa: PLR2004 - for a rate
        raise RecordingError(
            f"stream {stream.name!r} has {count} samples and {len(numeric)} numeric "
            "channels; a signal needs two or more samples, and numeric channels only"
        )
    time = np.maximum.accumulate(stream.column("time"))
    steps = np.diff(time)
    rate_hz = _rate(header.rate_hz, steps)
    if not rate_hz:
        raise RecordingError(
            f"stream {stream.name!r} states no rate, and its samples all have the same time; "
            "set the rate in the program that sends it"
        )
    even = abs(float(np.median(steps)) * rate_hz - 1.0) <= EVEN
    return Sampled(
        tuple(numeric),
        tuple(channel.type for channel in header.channels),
        tuple(channel.unit for channel in header.channels),
        rate_hz,
        time,
        1 + np.flatnonzero(steps > (LOST / rate_hz if even else SILENT_S)),
        stream,
    )


def _rate(stated: float, steps: FloatArray) -> float:
    """Return the rate in Hz that a source states, if it is about true, or the one measured."""
    going = steps[steps <= SILENT_S]
    span, usual = float(going.sum()), float(np.median(steps))
    measured = len(going) / span if span > 0.0 else 0.0
    found = [measured, *([1.0 / usual] if usual > 0.0 else [])]
    if stated and any(abs(rate / stated - 1.0) <= NOMINAL for rate in found):
        return stated
    return measured
