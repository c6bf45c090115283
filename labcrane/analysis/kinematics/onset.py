"""Onset of a movement, of the machine's and of the hand's."""

import numpy as np

from labcrane.types import FloatArray

ROUNDING_S = 1e-9
"""Elapsed times are sums of whole ticks."""


def onset(
    elapsed: FloatArray, speed: FloatArray, distance: FloatArray, *,
    threshold: float, hold_s: float, nearer: float,
) -> int | None:  # fmt: skip
    """Return the tick at which the tip began to move, or None where it never did.

    The first tick, from the front, of the first stretch in which the tip is faster than
    ``threshold`` for at least ``hold_s``, however fast it becomes later: strokes before a halt are
    part of the movement. The threshold is absolute, above the sensor noise of a tip at rest: with a
    share of the peak speed, the onsets of slow and of fast movements would not be comparable.

    Speed from the first tick on is the end of the movement before, and not an onset, unless the tip
    comes nearer to the target by ``nearer``.

    Parameters
    ----------
    elapsed
        Since the trial's start, in s, shape ``(n,)``.
    speed, distance
        Of the tip in m/s, and from the target's centre in m, shape ``(n,)``.
    threshold, nearer
        In m/s and m.
    hold_s
        In s.
    """
    for stretch in _stretches(speed > threshold):
        first, last = int(stretch.start), int(stretch.stop) - 1
        if first == 0:
            begun = bool((distance[0] - distance[stretch] >= nearer).any())
        else:
            begun = bool(elapsed[last] - elapsed[first] >= hold_s - ROUNDING_S)
        if begun:
            return first
    return None


def reaction(elapsed: FloatArray, command: FloatArray) -> float:
    """Return when a stick first left its dead zone, in s since the trial's start; NaN for never.

    A command is 0 while all sticks are in their dead zones. A stick that is held since the movement
    before is not a reaction: only a command after a tick without one is a reaction.

    Parameters
    ----------
    elapsed
        Since the trial's start, in s, shape ``(n,)``.
    command
        Of the joints, in rad/s, shape ``(n, n_joints)``.
    """
    given = command.any(axis=1)
    answers = np.flatnonzero(given & np.logical_or.accumulate(~given))
    return float(elapsed[answers[0]]) if answers.size else float("nan")


def _stretches(on: np.ndarray) -> list[slice]:
    """Return the spans in which a condition holds continuously."""
    turns = np.flatnonzero(np.diff(on, prepend=False, append=False))
    return [slice(int(a), int(b)) for a, b in zip(turns[::2], turns[1::2], strict=True)]
