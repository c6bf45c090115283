"""Repeats: samples that a source sends again, with the stamps that they had.

Only the first of them was taken: the others tell nothing of how the source samples, and are left
out until the rest is corrected. Then each has the time of that which it repeats.
"""

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from labcrane.streams.sync.quality import ClockSegment
from labcrane.streams.sync.raw import RawStream
from labcrane.types import FloatArray

Which = npt.NDArray[np.intp]

HALF = 0.5
"""Repeats that take less than this part of their periods were sent again."""

AROUND = 200
"""So many samples before and after a run of repeats show whether they took time: delays pass."""


def first_of(stamps: FloatArray, rate_hz: float) -> Which | None:
    """Return the sample that each one of a regular stream repeats; None if none does.

    What is sent again takes no time: what was taken around it fills that. Where several samples
    share a stamp, or chunks that waited are sent at once and each stamped with that moment, all of
    them are needed to fill it.

    Parameters
    ----------
    stamps
        On the source's clock, in the order of arrival, shape ``(n,)``.
    rate_hz
        Nominal rate.
    """
    rising = np.diff(stamps) > 0.0
    if rising.all() or not rising.any():
        return None
    _, first, which = np.unique(stamps, return_index=True, return_inverse=True)
    of = np.asarray(first[which], dtype=np.intp)
    again = of != np.arange(len(stamps))
    if not again.any():
        return None
    edges = np.diff(np.r_[0, again.astype(int), 0])
    begins, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    last = len(stamps) - 1
    low, high = np.maximum(begins - AROUND, 0), np.minimum(ends + AROUND, last)
    repeats = np.r_[0, np.cumsum(again)]
    some = (repeats[high + 1] - repeats[low + 1]).astype(float)
    latest = np.maximum.accumulate(stamps)
    periods = (latest[high] - latest[low]) / _period(stamps, rising, 1.0 / rate_hz)
    more = (periods - (high - low - some)) / np.maximum(some, 1.0)
    return of if float(np.median(more)) < HALF else None


def _period(stamps: FloatArray, rising: npt.NDArray[np.bool_], nominal: float) -> float:
    """Return the usual period: from one stamp to another, or by their count; the likelier one."""
    most = min(AROUND, len(stamps) - 1)
    known = (
        float(np.median(np.diff(stamps)[rising])),
        float(np.median(stamps[most:] - stamps[:-most])) / most,
    )
    return min(known, key=lambda one: abs(np.log(max(one, 1e-9) / nominal)))


def back_s(stamps: FloatArray) -> float:
    """Return by how much stamps of a regular stream went back, all steps added up."""
    steps = np.diff(stamps)
    usual = float(np.median(steps[steps > 0.0]))
    return float(np.sum(usual - steps[steps < 0.0]))


def left_out(raw: RawStream, own: npt.NDArray[np.bool_]) -> RawStream:
    """Return the stream of these samples alone."""
    before = np.r_[0, np.cumsum(own)]
    arrivals, resets = raw.arrivals.copy(), raw.resets.copy()
    if len(arrivals):
        arrivals[:, 0] = before[np.clip(arrivals[:, 0].astype(int), 0, len(own))]
    if len(resets):
        resets[:, 1:] = before[np.clip(resets[:, 1:].astype(int), 0, len(own))]
    return replace(
        raw,
        stamps=raw.stamps[own],
        arrivals=arrivals,
        resets=resets,
        index=None if raw.index is None else raw.index[own],
    )


def put_back(
    segments: tuple[ClockSegment, ...], own: npt.NDArray[np.bool_]
) -> tuple[ClockSegment, ...]:
    """Return the segments of the whole stream, from those of these samples alone."""
    where = np.r_[np.flatnonzero(own), len(own)]
    return tuple(
        replace(each, start=int(where[each.start]), stop=int(where[each.stop])) for each in segments
    )


def place_of(of: Which) -> Which:
    """Return, for each sample, its place among those that are not repeats, shape ``(n,)``."""
    return np.asarray((np.cumsum(of == np.arange(len(of))) - 1)[of], dtype=np.intp)
