"""Stick measures: how the operator used the sticks."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from labcrane.types import FloatArray


@dataclass(frozen=True, slots=True)
class StickUse:
    """How sticks were used during a movement.

    Attributes
    ----------
    simultaneous
        Fraction of the time with two or more axes beyond the dead zone.
    axes
        Mean number of axes beyond it. The measure of forestry's "functions used simultaneously"
        (Polowy & Rutkowski 2024, Forests 15:1277).
    bimanual
        Of the time with any stick in use, the fraction with more than one; NaN when none was.
    """

    simultaneous: float
    axes: float
    bimanual: float


def stick_use(axes: Mapping[str, FloatArray], dead_zone: float) -> StickUse:
    """Return how sticks were used.

    Parameters
    ----------
    axes
        By name; what stands before the last dot is the stick: ``left.x``. Shape ``(n,)`` each.
    dead_zone
        Deflection beyond which an axis is in use, as a fraction of full scale.
    """
    used = {name: np.abs(values) > dead_zone for name, values in axes.items()}
    count = np.sum(list(used.values()), axis=0)
    sticks = {name.rpartition(".")[0] for name in used}
    hands = np.sum(
        [
            np.any([use for name, use in used.items() if name.rpartition(".")[0] == stick], axis=0)
            for stick in sticks
        ],
        axis=0,
    )
    any_use = int((hands > 0).sum())
    return StickUse(
        simultaneous=float((count > 1).mean()),
        axes=float(count.mean()),
        bimanual=float((hands > 1).sum() / any_use) if any_use else float("nan"),
    )


def reversals(axis: FloatArray, hysteresis: float) -> int:
    """Return how often an axis changed its direction by more than ``hysteresis``.

    The stick's counterpart of steering reversals: turning points between which the axis moves by
    more than a fraction of full scale.
    """
    if float(axis.max() - axis.min()) <= hysteresis:
        return 0
    steps = np.diff(axis)
    moved = np.flatnonzero(steps)
    ways = np.sign(steps[moved])
    turns = moved[:-1][ways[:-1] != ways[1:]] + 1
    ends = np.concatenate([axis[:1], axis[turns], axis[-1:]])
    # A swing within the hysteresis and within both of its neighbours moves nothing that is counted:
    # all that there are go at once, until none is left.
    while True:
        swings = np.abs(np.diff(ends))
        least = swings <= hysteresis
        least[1:] &= swings[1:] < swings[:-1]  # of several alike the first
        least[:-1] &= swings[:-1] <= swings[1:]
        if not least.any():
            return len(swings) - 1
        gone = np.zeros(len(ends), bool)
        gone[:-1] |= least
        gone[1:] |= least
        # At an end the swing's own end goes, and the turning point stays.
        gone[1] &= not least[0] or len(least) == 1
        gone[-2] &= not least[-1] or len(least) == 1
        ends = ends[~gone]
        if len(ends) < 2:  # noqa: PLR2004 - no swing is left
            return 0


def coordination(
    left: FloatArray, right: FloatArray, rate_hz: float, most_s: float = 0.5
) -> tuple[float, float]:
    """Return the peak of the cross-correlation of two hands' deflections, and its lag in seconds.

    Lags are searched to ``most_s`` either way: the best of all lags of a movement is high for hands
    that have nothing to do with each other.

    Parameters
    ----------
    left, right
        Deflection, 0 or more, shape ``(n,)``.

    Returns
    -------
    tuple[float, float]
        Correlation, -1 to 1, and lag, positive when the right hand follows the left; NaN when one
        of them never moved.
    """
    from scipy.signal import correlate

    a, b = left - left.mean(), right - right.mean()
    power = float(np.sqrt((a @ a) * (b @ b)))
    if power == 0.0:
        return float("nan"), float("nan")
    lags = np.arange(1 - len(a), len(a))
    near = np.abs(lags) <= most_s * rate_hz
    values, lags = correlate(b, a)[near] / power, lags[near]
    peak = int(np.argmax(values))
    return float(values[peak]), float(lags[peak]) / rate_hz


def effort(command: FloatArray, speeds: FloatArray) -> float:
    """Return the root mean square of the commands over all joints, as a fraction of full speed.

    ``command`` is in rad/s, shape ``(n, n_joints)``; ``speeds`` has shape ``(n_joints,)``.
    """
    return float(np.sqrt(((command / speeds) ** 2).mean()))


def limit_hits(angles: FloatArray, limits: FloatArray, tolerance: float) -> int:
    """Return how often a joint came to one of its limits; a joint that starts there counts once.

    Parameters
    ----------
    angles
        In rad, shape ``(n, n_joints)``.
    limits
        Lowest and highest angle in rad, shape ``(n_joints, 2)``.
    tolerance
        Distance in rad at which a joint is at its limit.
    """
    at = (angles <= limits[:, 0] + tolerance) | (angles >= limits[:, 1] - tolerance)
    before = np.vstack([np.zeros((1, at.shape[1]), bool), at[:-1]])
    return int((at & ~before).sum())
