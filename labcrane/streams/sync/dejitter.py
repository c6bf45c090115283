"""Even time stamps for sources that sample evenly but stamp unevenly.

Only where that is shown to help, or asked for: what scatters in a stream may be its samples. Where
it is shown, the sample clock is followed by the smoother that follows clocks, as a phase-locked
loop would, but from both sides. Where it is asked for, lines are fitted to stretches of two minutes
that overlap by half and fade into each other.
"""

import itertools
from collections.abc import Callable
from enum import StrEnum

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from labcrane.streams.sync.smoother import smooth
from labcrane.types import FloatArray

CRYSTAL_WALK = 1e-6
"""Variance by which a sampler's rate usually walks in a second, in ppm squared."""

SURE_OF_ALL = 3.5
"""A rate that is wrong is wrong for all samples at once. So many standard deviations about a line
hold all of it with 99.8 % (Working and Hotelling 1929: the root of twice F with 2 degrees)."""

FEWEST = 50
MOST_BLOCKS = 100

STRETCH_S = 120.0

ROUNDING_S = 1e-12

PASSING_S, SOON_S = 5.0, 1.0
"""Delays pass within the first; what has shifted all samples for longer is a gap. Within the second
some samples of most seconds are hardly delayed."""

Line = Callable[[FloatArray], FloatArray]


class Dejitter(StrEnum):
    """How uneven timestamps are dejittered."""

    AUTO = "auto"  # only where it is shown to help
    NONE = "none"
    LEAST_SQUARES = "least_squares"  # stamps scatter evenly around the truth
    ENVELOPE = "envelope"  # stamps are late by a transport delay that has a known minimum


def even(times: FloatArray, index: FloatArray, way: Dejitter) -> FloatArray:
    """Return dejittered times, shape ``(n,)``.

    Parameters
    ----------
    times
        In seconds, shape ``(n,)``, of one clock.
    index
        Which sample each one is, shape ``(n,)``: counts on over samples that are missing.
    way
        With ``ENVELOPE``, the line lies below all times: at the truth plus the least delay.
    """
    if way in {Dejitter.NONE, Dejitter.AUTO}:
        return times
    result = times.copy()
    for start, stop in runs(times, index):
        if stop - start > 2:  # noqa: PLR2004
            result[start:stop] = _follow(times[start:stop], index[start:stop], way)
    return result


def follow_sample_clock(times: FloatArray, index: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the times of a steady sample clock whose stamps scatter, and their error at 95 %.

    Parameters
    ----------
    times
        In seconds, shape ``(n,)``, of one clock, in the order of ``index``.
    index
        Which sample each one is, shape ``(n,)``.
    """
    due = even_line(times, index)
    blocks = np.array_split(np.arange(len(times)), min(max(len(times) // FEWEST, 3), MOST_BLOCKS))
    middle = np.array([float(due[block].mean()) for block in blocks])
    rest = np.array([float((times[block] - due[block]).mean()) for block in blocks])
    change = np.abs(np.diff(rest)) / np.sqrt(2.0)
    # Means of late stamps have a long tail, which the median does not see and a mean does.
    scatter = max(1.4826 * float(np.median(change)), float(np.sqrt(np.mean(change**2)))) + 1e-6
    followed = smooth(
        middle,
        rest,
        np.zeros(len(rest)),
        scatter_s=(scatter, 2.0 * scatter),
        usual_walk=CRYSTAL_WALK,
    )
    offset, deviation = followed.at(due)
    return due + offset, SURE_OF_ALL * deviation


def even_line(times: FloatArray, index: FloatArray) -> FloatArray:
    """Return the straight line through times, by least squares, shape ``(n,)``."""
    return np.asarray(_least_squares(times, index)(index))


def runs(times: FloatArray, index: FloatArray) -> list[tuple[int, int]]:
    """Return the ranges without a gap: nothing is known of how many samples a gap swallowed."""
    if len(times) < 2:  # noqa: PLR2004
        return [(0, len(times))] if len(times) else []
    steps, counts = np.diff(times), np.diff(index)
    period = float(np.median(steps / np.maximum(counts, 1.0)))
    odd = np.abs(steps - period * counts)
    # Eight times what nearly all steps stay below: chunks that travel unevenly are not gaps.
    limit = min(max(1.5 * period, 8.0 * float(np.quantile(odd, 0.995))), 1.0)
    rest = times - period * index
    near = max(round(PASSING_S / period), 1)
    cuts = [
        int(k) + 1
        for k in np.flatnonzero((odd > limit) | (counts < 1.0))
        if counts[k] < 1.0
        or abs(rest[k + 1 : k + 1 + near].min() - rest[max(k + 1 - near, 0) : k + 1].min()) > limit
    ]
    bounds = [0, *cuts, len(times)]
    return list(itertools.pairwise(bounds))


def left_open(times: FloatArray, dejittered: FloatArray, way: Dejitter) -> FloatArray:
    """Return how far lines that were asked for may be off, in seconds, shape ``(n,)``.

    The soonest of a second's samples, or the middle one, would lie on them if they were right; of
    samples that are rarer, each. What lies apart was delayed for so long, or the lines are wrong,
    as after samples that were lost uncounted: nothing tells which.
    """
    apart, span = times - dejittered, float(np.ptp(times))
    count = min(max(int(span / SOON_S), 1), len(times))
    blocks = np.array_split(np.arange(len(times)), count)
    soonest = 0.0 if way is Dejitter.ENVELOPE else 0.5
    level = np.array([abs(float(np.quantile(apart[block], soonest))) for block in blocks])
    wide = round(PASSING_S / SOON_S)
    worst = sliding_window_view(np.pad(level, wide, mode="edge"), 2 * wide + 1).max(axis=1)
    return np.repeat(worst, [len(block) for block in blocks])


def _follow(times: FloatArray, index: FloatArray, way: Dejitter) -> FloatArray:
    """Return the times on lines that fade into each other."""
    fit = _envelope if way is Dejitter.ENVELOPE else _least_squares
    duration = times[-1] - times[0]
    if duration < 1.5 * STRETCH_S:
        return fit(times, index)(index)
    count = round(duration / (STRETCH_S / 2)) - 1
    half = (index[-1] - index[0]) / (count + 1)
    total, result = np.zeros(len(times)), np.zeros(len(times))
    for k in range(count):
        centre = index[0] + (k + 1) * half
        here = slice(*np.searchsorted(index, (centre - half, centre + half)))
        near = index[here]
        weight = np.clip(1.0 - np.abs(near - centre) / half, 1e-9, 1.0)
        if k == 0:
            weight[near < centre] = 1.0
        if k == count - 1:
            weight[near > centre] = 1.0
            here = slice(here.start, len(times))
            near = index[here]
            weight = np.r_[weight, np.ones(len(near) - len(weight))]
        result[here] += weight * fit(times[here], near)(near)
        total[here] += weight
    return result / total


def _least_squares(times: FloatArray, index: FloatArray) -> Line:
    middle, mean = index.mean(), times.mean()
    away = index - middle
    slope = float(away @ (times - mean)) / float(away @ away)
    return lambda at: mean + slope * (at - middle)


def _envelope(times: FloatArray, index: FloatArray) -> Line:
    """Return the highest line below all times: the hull's edge under their middle.

    Moon, Skelly and Towsley 1999, Estimation and removal of clock skew from network delay
    measurements. Whatever is below a line takes the place of its end on that side.
    """
    rough = _least_squares(times, index)
    late, away = times - rough(index), index - (index[0] + index[-1]) / 2
    left, right = 0, len(late) - 1
    while True:
        slope = (late[right] - late[left]) / (away[right] - away[left])
        above = late - late[left] - slope * (away - away[left])
        lowest = int(np.argmin(above))
        if above[lowest] > -ROUNDING_S:
            first, level = index[left], late[left]
            return lambda at: rough(at) + level + slope * (at - first)
        if away[lowest] < 0.0:
            left = lowest
        else:
            right = lowest
