"""Levels: samples lost where stamps scatter, so that no single step shows them.

Without a counter, a lost sample leaves all stamps behind it late by one period. The means of enough
stamps before and behind show that, wherever they differ by less than a part of a period by chance.
"""

from dataclasses import dataclass

import numpy as np

from labcrane.types import FloatArray

LEAST = 5
"""Stamps on each side, at least."""

SHARP = 0.1
"""Means of both sides differ by less than this part of a period by chance, a standard deviation:
half a period, which nothing counts as a loss, is five of them."""

WHOLE = 0.3
"""What was lost makes up whole periods, to three of these standard deviations."""

LONG_HOLE = 20
"""Across holes of more periods it is not known well enough where samples belong."""

FEWEST = 12
"""So many means at least tell by how much they scatter."""

LIKELY = 10.0
"""Places of a loss that are less likely than the best one by more than this, as a logarithm, are
none: stamps' delays have longer tails than the normal distribution that it is computed by."""

FEW_ODD = 0.01
"""Not more than this part of packets is of another size: a first or a last one that was cut."""


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


def find(time: FloatArray, period: float, index: FloatArray | None = None) -> Levels | None:
    """Return what was lost; None where stamps scatter by too much, or shift for another reason.

    Parameters
    ----------
    time
        Stamps in seconds, shape ``(n,)``, in the order of their samples.
    period
        Of the sampler, in seconds, as most spans of samples show it.
    index
        Which sample each one is of those that came, shape ``(n,)``; by default each is the next.
    """
    count = len(time)
    taken = np.arange(float(count)) if index is None else index
    late = (time - time[0]) / period - taken
    wide = LEAST
    while count >= FEWEST * wide:
        sums = np.r_[0.0, np.cumsum(late)]
        means = (sums[wide:] - sums[:-wide]) / wide
        rise = means[wide:] - means[:-wide]
        usual = float(np.median(rise))  # by as much as the period is not quite the sampler's
        if 1.4826 * float(np.median(np.abs(rise[::wide] - usual))) < SHARP:
            slope = usual / wide * np.arange(count)
            found = _counted(late - slope, means - slope[: len(means)], rise - usual)
            if found is not None:
                return found
        wide *= 2
    return None


def of_packets(time: FloatArray, period: float) -> Levels | None:
    """Return what was lost of samples that are stamped together, packet by packet.

    None where packets are not of one size, too.

    Parameters
    ----------
    time, period
        As of :func:`find`.
    """
    starts = np.r_[0, np.flatnonzero(np.diff(time) > period / 2.0) + 1]
    counts = np.diff(np.r_[starts, len(time)])
    size = float(np.median(counts))
    if size < 2.0 or (counts % size != 0.0).mean() > FEW_ODD:  # noqa: PLR2004
        return None
    found = find(time[starts], size * period, starts / size)
    if found is None:
        return None
    return Levels(*(size * np.repeat(each, counts) for each in (found.lost, found.unsure)))


def _counted(late: FloatArray, means: FloatArray, rise: FloatArray) -> Levels | None:
    """Count the whole periods by which levels rise, and find where each of them was lost.

    Delays pass, so that levels on both sides of one are the same; what was lost does not come back.
    Where the level is known on both sides, the likeliest place of the step between is where the sum
    of all distances from the middle is least.

    Parameters
    ----------
    late
        How late each sample is, in periods, shape ``(n,)``.
    means, rise
        Mean of the samples from each one on, and by how much the next mean is above it.
    """
    wide = len(means) - len(rise)
    variance = float(np.var(np.diff(late))) / 2.0
    lost, unsure = np.zeros((2, len(late)))
    odd = np.flatnonzero(np.abs(rise) > 0.5) + wide  # noqa: PLR2004
    for near in np.split(odd, np.flatnonzero(np.diff(odd) > wide) + 1):
        if not len(near):
            continue
        first, last = max(near[0] - wide // 2, wide), min(near[-1] + wide // 2, len(means) - 1)
        before = float(means[first - wide])
        periods = float(means[last]) - before
        if abs(periods - round(periods)) > WHOLE or not 0.0 <= round(periods) < LONG_HOLE:
            return None
        for level in range(round(periods)):
            beyond = np.cumsum(late[first:last] - before - level - 0.5)
            likely = np.flatnonzero(beyond - beyond.min() < LIKELY * variance)
            lost[first + int(np.argmin(beyond)) + 1 :] += 1.0
            unsure[first + likely[0] + 1 : first + likely[-1] + 1] += 1.0
    return Levels(lost, unsure)
