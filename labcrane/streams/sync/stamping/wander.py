"""Wander: how the level of stamps, late or soon by their count, changes from second to second.

A way that gets slower, a buffer that grows, a clock that is set and a sampler that waits all change
it, at once or by and by. Nothing in the stamps tells one from the other, so that nothing is moved,
and the uncertainty holds all of them.
"""

import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import sliding_window_view

from labcrane.types import FloatArray

BLOCK_S, FEWEST = 1.0, 10
"""A level is that of so many seconds and samples: single ones scatter."""

PASSING = 20
"""What is back at its level within as many blocks has passed: those before and behind are right."""

STRETCH = 10
"""Rates are compared over so many blocks."""

SURE = 3.0
"""Levels differ by as many standard deviations by chance."""

QUARTZ = 5e-6
"""No quartz changes its rate by more while it warms up."""

MOST_S = 0.5
"""No buffer on the way holds more: that is a pause, or a sampler whose rate changes."""


def find(time: FloatArray, index: FloatArray, period: float) -> FloatArray:
    """Return how the level of stamps changes, in seconds, shape ``(n,)``.

    How far the level around each sample is from that of any other time, less what a quartz may have
    done in between.

    Parameters
    ----------
    time, index
        Stamps in seconds, without the pauses and shifts that are known, and their count, shape
        ``(n,)``.
    period
        From one sample to the next.
    """
    size = max(FEWEST, round(BLOCK_S / period))
    count = len(time) // size
    if count < 2:  # noqa: PLR2004
        return np.zeros(len(time))
    due = period * (index - index[0])
    late = (time - time[0] - due)[: count * size].reshape(count, size)
    level = np.sort(late, axis=1)[:, size // 4 : size - size // 4].mean(axis=1)
    at = due[size // 2 :: size][:count]
    far = min(max(STRETCH, count // 5), count - 1)
    level = level - at * _usual((level[far:] - level[:-far]) / (at[far:] - at[:-far]))
    lasting = _lasting(level)
    walked = _walked(at, lasting)
    if float(np.ptp(lasting - walked)) > MOST_S:
        walked = lasting
    level, lasting = level - walked, lasting - walked
    by_chance = SURE * 1.4826 * float(np.median(np.abs(level - lasting)))
    open_s = np.maximum(np.maximum(lasting.max() - level, level - lasting.min()) - by_chance, 0.0)
    around = sliding_window_view(np.pad(open_s, 1, mode="edge"), 3).max(axis=1)
    sizes = np.diff(np.r_[np.arange(count) * size, len(time)])
    return np.repeat(around, sizes)


def _usual(rates: FloatArray) -> float:
    """Return the middle of those rates that are most alike, and half of all."""
    rates = np.sort(rates)
    half = len(rates) // 2
    first = int(np.argmin(rates[half:] - rates[: len(rates) - half]))
    return float(np.median(rates[first : first + half + 1]))


def _lasting(level: FloatArray) -> FloatArray:
    """Return the level around each block, as most of those beside it have it."""
    wide: npt.NDArray[np.float64] = np.pad(level, PASSING, constant_values=np.nan)
    return np.asarray(np.nanmedian(sliding_window_view(wide, 2 * PASSING + 1), axis=1))


def _walked(at: FloatArray, lasting: FloatArray) -> FloatArray:
    """Return by how much levels may change with a quartz that warms up, about its usual rate."""
    knots = np.unique(np.r_[0 : len(at) : STRETCH, len(at) - 1])
    most = QUARTZ * np.diff(at[knots])
    walked = np.cumsum(np.clip(np.diff(lasting[knots]), -most, most))
    return np.interp(at, at[knots], np.r_[0.0, walked])
