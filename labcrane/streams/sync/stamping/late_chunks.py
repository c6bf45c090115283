"""Late chunks: what the soonest of them show about a sampler that stamps chunks when sent.

They wait for as long as their program and its computer let them. Delays pass; what was lost does
not come back.
"""

import numpy as np

from labcrane.types import FloatArray

STEADY = 1.5e-4
"""No crystal is further off the rate that stamps are computed by: what is, was lost."""

PARTS, SOONEST = 5, 4
"""The soonest chunks of the first part and of the last tell what was lost between."""

LAST = 10


def lost_between(index: FloatArray, rest: FloatArray, period: float) -> tuple[bool, float]:
    """Return whether samples were lost between chunks, and the period.

    Delays pass, so that some chunk of every while is hardly delayed; what was lost lets even those
    come later from then on. Where the soonest chunks are too few or too unlike to tell, nothing is
    said to be lost.

    Parameters
    ----------
    index, rest
        Number of each chunk's first sample, and how late it is stamped by the usual step, in
        seconds, shape ``(n_chunks,)``.
    period
        The usual step, in seconds.
    """
    part = len(index) // PARTS
    if part < SOONEST:
        return False, period + slope(index, rest)
    begin, end = np.argsort(rest[:part]), len(rest) - part + np.argsort(rest[-part:])
    rise = float(rest[end[0]] - rest[begin[0]])
    doubt = float(np.ptp(rest[begin[:SOONEST]]) + np.ptp(rest[end[:SOONEST]]))
    apart = float(index[end[0]] - index[begin[0]])
    if rise > STEADY * apart * period + 2.0 * doubt:
        return True, period
    return False, period + rise / apart


def lost_before(rest: FloatArray, period: float) -> FloatArray:
    """Return how many samples were lost before each chunk, shape ``(n_chunks,)``.

    No chunk comes before its samples: what even the soonest of all that follow is late by was lost.
    The last few may all be late for another reason, and tell nothing.

    Parameters
    ----------
    rest
        How late each chunk is stamped by the usual step, in seconds, shape ``(n_chunks,)``.
    period
        Of the samples, in seconds.
    """
    soonest = np.minimum.accumulate(rest[::-1])[::-1]
    known = np.minimum(soonest, soonest[-min(LAST, len(soonest))])
    return np.asarray(np.round((known - known[0]) / period))


def slope(x: FloatArray, y: FloatArray) -> float:
    """Return the slope of the straight line through points."""
    away = x - x.mean()
    return float(away @ (y - y.mean())) / float(away @ away)
