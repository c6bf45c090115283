"""Strays: samples of a steady sampler that are stamped beside their count for a while, and back.

A guest's clock stands still while its host is busy, and is turned until it has caught up; probes,
a second or more apart, see little of it. Or the sampler itself waited: nothing tells.
"""

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from labcrane.types import FloatArray

AWAY, AROUND = 3, 10
"""Seconds beside a sample from which to which its neighbours tell where it belongs."""

FEW = 5
"""So many samples of a second tell where it is."""

LONG_HOLE = 20
"""Across holes of more periods it is not known well enough where samples belong."""

LEAST_S = 3e-4
SHARP = 4.0
"""What strays does so by more than so many times what its neighbours stray from a straight line."""


def find(time: FloatArray, index: FloatArray, period: float, scatter: float) -> FloatArray | None:
    """Return by how much each sample strays, in seconds, shape ``(n,)``; None where none does.

    Parameters
    ----------
    time
        Of each sample in seconds, shape ``(n,)``.
    index
        Its count, shape ``(n,)``.
    period
        Usual time from one to the next.
    scatter
        Of the steps between them, a standard deviation.
    """
    due = period * (index - index[0])
    rest = time - time[0] - due
    second = np.floor(due).astype(int)
    starts = np.flatnonzero(np.r_[True, np.diff(second) > 0])
    counts = np.diff(np.r_[starts, len(time)])
    if period > 1.0 / FEW or len(starts) < 2 * AROUND + 1:
        return None
    level = np.array([float(np.median(part)) for part in np.split(rest, starts[1:])])
    at = np.add.reduceat(due, starts) / counts
    padded = np.pad(level, AROUND, mode="reflect", reflect_type="odd")
    whens = np.pad(at, AROUND, mode="reflect", reflect_type="odd")
    near = np.r_[: AROUND - AWAY + 1, AROUND + AWAY : 2 * AROUND + 1]
    around, when = (sliding_window_view(each, 2 * AROUND + 1)[:, near] for each in (padded, whens))
    half = len(near) // 2
    span = np.maximum(when[:, half:] - when[:, :half], 1.0)
    slope = np.median((around[:, half:] - around[:, :half]) / span, axis=1)
    flat = around - slope[:, None] * (when - at[:, None])
    middle = np.median(flat, axis=1)
    rough = 1.4826 * np.median(np.abs(flat - middle[:, None]), axis=1)
    line = np.repeat(middle, counts) + np.repeat(slope, counts) * (due - np.repeat(at, counts))
    stray = np.abs(rest - line)
    straight = np.repeat(rough, counts) < LEAST_S / SHARP
    found = np.where(straight & (stray > max(LEAST_S, 8.0 * scatter)), stray, 0.0)
    return found if found.any() else None
