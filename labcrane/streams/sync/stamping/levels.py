"""Levels: samples lost where stamps scatter, so that no single step shows them.

Without a counter, a lost sample leaves all stamps behind it late by one period. The means of enough
stamps before and behind show that, wherever they differ by less than a part of a period by chance.
"""

from dataclasses import dataclass

import numpy as np

from labcrane.streams.sync.stamping.strays import LONG_HOLE
from labcrane.types import FloatArray

LEAST = 25
"""Stamps on each side, at least."""

SHARP = 0.1
"""Means of both sides differ by less than this part of a period by chance, a standard deviation:
half a period, which nothing counts as a loss, is five of them."""

WHOLE = 0.3
"""What was lost makes up whole periods, to three of these standard deviations."""

FEWEST = 12
"""So many means at least tell by how much they scatter."""


@dataclass(frozen=True, slots=True)
class Levels:
    """What was lost, by the levels of stamps.

    Attributes
    ----------
    lost
        Samples that were lost before each one, shape ``(n,)``.
    unsure
        How many of them may have been lost before it or behind it, shape ``(n,)``.
    """

    lost: FloatArray
    unsure: FloatArray


def find(time: FloatArray, period: float) -> Levels | None:
    """Return what was lost; None where stamps scatter by too much, or shift for another reason.

    Parameters
    ----------
    time
        Stamps in seconds, shape ``(n,)``, in the order of their samples.
    period
        Of the sampler, in seconds, as most spans of samples show it.
    """
    count = len(time)
    sums = np.r_[0.0, np.cumsum(time - time[0] - period * np.arange(count))]
    wide = LEAST
    while count >= FEWEST * wide:
        means = (sums[wide:] - sums[:-wide]) / wide
        rise = means[wide:] - means[:-wide]
        usual = float(np.median(rise))  # by as much as the period is not quite the sampler's
        if 1.4826 * float(np.median(np.abs(rise[::wide] - usual))) < SHARP * period:
            means -= usual / wide * np.arange(len(means))
            return _counted(means / period, (rise - usual) / period, wide, count)
        wide *= 2
    return None


def _counted(means: FloatArray, rise: FloatArray, wide: int, count: int) -> Levels | None:
    """Count whole periods by which levels rise; ``means[k]`` is that of the samples from ``k``."""
    lost, unsure = np.zeros((2, count))
    odd = np.flatnonzero(np.abs(rise) > 0.5) + wide  # noqa: PLR2004
    for near in np.split(odd, np.flatnonzero(np.diff(odd) > wide) + 1):
        if not len(near):
            continue
        before, behind = near[0] - wide - wide // 2, near[-1] + wide // 2
        before, behind = max(before, 0), min(behind, count - wide)
        periods = float(means[behind] - means[before])
        if abs(periods - round(periods)) > WHOLE or not 0.0 < round(periods) < LONG_HOLE:
            return None
        lost[near[int(np.argmax(rise[near - wide]))] :] += round(periods)
        unsure[near[0] : near[-1] + 1] += round(periods)
    return Levels(lost, unsure)
