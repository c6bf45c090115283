"""Sampled signal: a stream as rows at one rate, and the row of each time."""

from collections.abc import Iterator, Sequence
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
"""Share by which most steps of dejittered timestamps may miss the usual one."""

AROUND = 20
"""Samples before and behind a long step of which the soonest tell how long a hole is."""

SILENT_S = 1.0
"""Seconds without a sample from which on some are missing although timestamps come in bursts."""


@dataclass(frozen=True)
class Sampled:
    """A stream of numbers at a steady rate: one row for each sample that its source took.

    Row n was taken n / :attr:`measured_hz` after :attr:`start`. The samples are as they were
    recorded, none is interpolated; a row whose sample never came is NaN in all channels. For any
    behaviour of the source's clock, :meth:`at` gives the row of a session's time.

    Attributes
    ----------
    labels, kinds, units
        Of each channel; a kind or a unit that the source does not state is empty.
    rate_hz
        Samples per second: what the source states, or what was measured where it states none, or
        one that is off by more than a thousandth.
    measured_hz
        Samples per second on the session's clock.
    start
        Time of row 0 by that rate, in seconds on the session's clock.
    time
        Of each recorded sample, in seconds on the session's clock, shape ``(n,)``.
    rows
        Row of each recorded sample, shape ``(n,)``.
    """

    labels: tuple[str, ...]
    kinds: tuple[str, ...]
    units: tuple[str, ...]
    rate_hz: float
    measured_hz: float
    start: float
    time: FloatArray
    rows: npt.NDArray[np.intp]
    _stream: Stream

    def __len__(self) -> int:
        """Return the number of rows."""
        return int(self.rows[-1]) + 1

    @cached_property
    def holes(self) -> npt.NDArray[np.intp]:
        """First missing row of each hole, and the row after its last, shape ``(n_holes, 2)``."""
        last = np.flatnonzero(np.diff(self.rows) > 1)
        return np.column_stack([self.rows[last] + 1, self.rows[last + 1]])

    @cached_property
    def data(self) -> FloatArray:
        """All rows in the channels' units, shape ``(n_rows, n_channels)``, kept in memory."""
        return np.concatenate([np.empty((0, len(self.labels))), *self.pieces()])

    def pieces(self, rows: int = CHUNK, bridged: Sequence[bool] = ()) -> Iterator[FloatArray]:
        """Yield :attr:`data` by at most so many rows, which are read from the file then.

        Parameters
        ----------
        rows
            The most rows of a piece.
        bridged
            For each channel, whether a straight line bridges its missing rows: filters and
            resampling spread NaN over all of a channel. None are by default.
        """
        for at in range(0, len(self), rows):
            until = min(at + rows, len(self))
            first, stop = np.searchsorted(self.rows, (at, until)).tolist()
            low, high = max(first - 1, 0), min(stop + 1, len(self.rows))
            values = self._stream.values(self.labels, low, high)
            there, piece = self.rows[first:stop], np.full((until - at, len(self.labels)), np.nan)
            missing = np.setdiff1d(np.arange(at, until), there, assume_unique=True)
            for number, name in enumerate(self.labels):
                piece[there - at, number] = values[name][first - low : stop - low]
                if bridged and bridged[number]:
                    filled = np.interp(missing, self.rows[low:high], values[name])
                    piece[missing - at, number] = filled
            yield piece

    def at(self, times: FloatArray) -> FloatArray:
        """Return the rows of times, counted from 0, with fractions.

        Parameters
        ----------
        times
            In seconds on the session's clock, shape ``(n_times,)``.

        Returns
        -------
        FloatArray
            Shape ``(n_times,)``, in rows; NaN before the first and after the last.
        """
        half = 0.5 / self.rate_hz  # what happened just before the first is at the first
        inside = (times >= self.time[0] - half) & (times <= self.time[-1] + half)
        return np.where(inside, np.interp(times, self.time, self.rows), np.nan)

    def off_s(self) -> float:
        """Return by how many seconds 99 % of samples miss the time of their row, at most.

        A few stamps are late by themselves; their samples are not.
        """
        off = np.abs(self.time - self.start - self.rows / self.measured_hz)
        return float(np.quantile(off, 0.99))


def sampled(stream: Stream) -> Sampled:
    """Return a stream of numbers as rows at a steady rate.

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
    usual = float(np.median(steps))
    even = usual > 0.0 and np.mean(np.abs(steps - usual) <= EVEN * usual) > 0.5  # noqa: PLR2004
    lost = steps > (LOST * usual if even else max(SILENT_S, LOST * usual))
    if time[0] == time[-1]:
        raise RecordingError(
            f"stream {stream.name!r} states no rate, and its samples all have the same time; "
            "set the rate in the program that sends it"
        )
    if not steps[~lost].any():  # several at a time, seconds apart
        lost[:] = False
    starts = np.concatenate([[0], 1 + np.flatnonzero(lost)])
    period = _period(time - time[0], starts)
    rows = _rows(time - time[0], starts, period)
    beyond = time - period * rows
    measured_hz, stated = 1.0 / period, header.rate_hz
    return Sampled(
        tuple(numeric),
        tuple(channel.type for channel in header.channels),
        tuple(channel.unit for channel in header.channels),
        stated if stated and abs(measured_hz / stated - 1.0) <= NOMINAL else measured_hz,
        measured_hz,
        float(beyond.min() + beyond.max()) / 2.0,
        time,
        rows,
        stream,
    )


def _period(time: FloatArray, starts: npt.NDArray[np.intp]) -> float:
    """Return the period of the line through the samples between holes, by least squares."""
    lengths = np.diff(starts, append=len(time))
    index = np.arange(len(time), dtype=np.float64)
    index, time = (
        each - np.repeat(np.add.reduceat(each, starts) / lengths, lengths) for each in (index, time)
    )
    return float(index @ time / (index @ index))


def _rows(time: FloatArray, starts: npt.NDArray[np.intp], period: float) -> npt.NDArray[np.intp]:
    """Return the row of each sample: consecutive, but for the periods that a hole lasts.

    Those are by which samples behind a long step stay late: a stamp that is late alone leaves no
    hole. Lengths are added up before they are rounded, so that parts of periods do not add up.

    Parameters
    ----------
    time
        Of each sample, shape ``(n,)``, in seconds.
    starts
        The first sample, and those behind a long step.
    period
        Of the samples, in seconds.
    """
    late = time / period - np.arange(len(time))
    length = np.zeros(len(starts))
    for number in range(1, len(starts)):
        at = starts[number]
        before = late[max(starts[number - 1], at - AROUND) : at].min()
        beyond = float(late[at : at + AROUND].min() - before)
        length[number] = beyond if beyond > 0.5 else 0.0  # noqa: PLR2004 - less is not a period
    missing = np.rint(np.cumsum(length)).astype(np.intp)
    rows: npt.NDArray[np.intp] = np.arange(len(time))
    rows += np.repeat(missing, np.diff(starts, append=len(time)))
    return rows
