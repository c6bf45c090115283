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
    levels = [level - at * rate for rate in _usual(level, at)]
    spans, open_s = zip(*(_open(each, at) for each in levels), strict=True)
    if max(spans) > MOST_S:  # the sampler's rate changed: only what passes is a delay
        away = np.abs(levels[0] - _lasting(levels[0]))
        open_s = (np.maximum(away - _by_chance(levels[0]), 0.0),)
    open_s = sliding_window_view(np.pad(np.max(open_s, axis=0), 1, mode="edge"), 3).max(axis=1)
    sizes = np.diff(np.r_[np.arange(count) * size, len(time)])
    return np.repeat(open_s, sizes)


def _open(level: FloatArray, at: FloatArray) -> tuple[float, FloatArray]:
    """Return over how much levels that last range, and how far each is from those."""
    lasting = _lasting(level)
    walked = _walked(at, lasting)
    chance = _by_chance(level)
    level, lasting = level - walked, lasting - walked
    # At the ends nothing shows that a low level passed, and no stamp is before its sample.
    ends = np.r_[level[[0, -1]], 2.0 * level[[0, -1]] - level[[1, -2]]]
    lowest = min(float(lasting.min()), float(ends.min()) + chance)
    away = np.maximum(lasting.max() - level, level - lowest)
    return float(np.ptp(lasting)), np.maximum(away - chance, 0.0)


def _usual(level: FloatArray, at: FloatArray) -> tuple[float, float, float]:
    """Return middle, least and largest of those rates that are most alike, and half of all.

    They differ by more than by chance where delays change all the time.
    """
    far = min(max(STRETCH, len(at) // 5), len(at) - 1)
    rates = np.sort((level[far:] - level[:-far]) / (at[far:] - at[:-far]))
    half = len(rates) // 2
    first = int(np.argmin(rates[half:] - rates[: len(rates) - half]))
    middle = float(np.median(rates[first : first + half + 1]))
    chance = _by_chance(level - at * middle) / float(at[far] - at[0])
    return (
        middle,
        min(float(rates[first]) + chance, middle),
        max(float(rates[first + half]) - chance, middle),
    )


def _by_chance(level: FloatArray) -> float:
    """Return by how much single levels differ by chance from those around them."""
    return SURE * 1.4826 * float(np.median(np.abs(level - _lasting(level))))


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
