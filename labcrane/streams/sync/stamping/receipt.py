"""Receipt: samples of a steady sampler that wait before they are stamped.

A serial port, a USB poll or a radio's connection event hands them over later than they were taken,
in their order. The count goes on evenly then, nothing is lost, and stamps scatter as delays do:
behind a lower edge, on the grid of polls, or in chunks that were computed back from one stamp.
"""

from dataclasses import dataclass

import numpy as np

from labcrane.types import FloatArray

ENOUGH, MANY = 400, 2000
BLOCKS, LEAST = 40, 50
EDGE = 0.05
"""The part of a block's samples that is sooner than its lower edge."""

STEADY, STEADY_POLLED = 0.4, 0.75
"""Edges that stray from a straight line by more periods have lost or gained a sample."""

LITTLE_S = 5e-5
LITTLE = 0.005
"""What scatters by less than both, the second in periods, is reported unchanged."""

SKEWED = 1.6
"""Delays reach so much further up from their median than down; errors of either sign do not."""

HARD = 0.25
"""Below their usual ones delays end at once: so little of that lies between the soonest in twenty
and the soonest in two hundred. Of errors that scatter by chance it is half and more."""

NEW = 0.8
"""Delays are new in each sample: neighbours are less alike than this correlation."""

ON_GRID, NEARLY_ALL = 0.1, 0.95
SHORTEST_POLL_S = 2e-3
SOME = 0.01
EQUAL_S = 3e-6
SAME = 0.5
"""Where this part of all steps is the same, stamps are computed and not taken."""

PHASES = 400
"""So many polls show the phases of a while."""

SLICE = 200_000
"""So many samples show how neighbours are alike."""


@dataclass(frozen=True, slots=True)
class Receipt:
    """How far stamps lie from a steady clock of their samples.

    Attributes
    ----------
    spread_s
        At 97.5 %: whether samples were taken when they were stamped, or evenly, nothing tells.
    period
        Of the sampler, in seconds.
    polled
        Whether stamps lie on the grid of polls: the sampler's phase slides along it for minutes.
    strayed_s
        By how much the soonest samples of a while stray from a steady clock.
    """

    spread_s: float
    period: float
    polled: bool
    strayed_s: float


def open_shift(time: FloatArray, index: FloatArray) -> float:
    """Return by how much all samples may be shifted with no stamp on a grid of polls changed.

    Polls at phases of the sampler that differ leave no room. Where the interval is a simple ratio
    of what they wait for, the same few phases come again and again, and slide between two of them
    for minutes, as if the sampler were slower or faster. 0 where stamps are on no such grid.

    Parameters
    ----------
    time, index
        As of :func:`find`.
    """
    steps = np.diff(time)
    apart = np.abs(steps - np.median(steps)) > EQUAL_S if _is_computed(steps) else steps > EQUAL_S
    last = np.r_[np.flatnonzero(apart), len(time) - 1]
    interval = _poll_interval(np.diff(time[last])) if len(last) > LEAST else 0.0
    if not interval:
        return 0.0
    taken = time[np.repeat(last, np.diff(last, prepend=-1))]
    # Samples that always come together are waited for together.
    together = max(int(np.gcd.reduce(np.diff(index[last[:-1]]).astype(int))), 1)
    whole = (index - index[last[0]]) % together == 0.0
    shift = 0.0
    for part in np.array_split(np.flatnonzero(whole), whole.sum() // PHASES + 1):
        due, late = index[part] - index[part[0]], taken[part] - taken[part[0]]
        period, level = np.polyfit(due, late, 1)
        phases = np.sort((late - level - period * due) % interval)
        shift = max(shift, float(np.diff(phases, append=phases[0] + interval).max()))
    return shift


def find(time: FloatArray, index: FloatArray) -> Receipt | None:
    """Return how samples were received; None where nothing shows that they waited.

    Parameters
    ----------
    time
        Stamps in seconds, shape ``(n,)``, in the order of arrival.
    index
        The sampler's count, shape ``(n,)``.
    """
    steps = np.diff(time)
    if len(time) < ENOUGH or (np.diff(index) <= 0.0).any():
        return None
    computed, polled = _is_computed(steps), _poll_interval(steps) > 0.0
    # Chunks computed back by a slower rate than theirs reach behind the one before.
    if (steps < -EQUAL_S).any() and not computed:
        return None
    period, level = np.polyfit(index - index[0], time - time[0], 1)
    rest = time - time[0] - level - period * (index - index[0])
    period = float(period)
    blocks = np.array_split(rest, min(BLOCKS, len(rest) // LEAST))
    # Of computed stamps the soonest are exact; of others, one may be soon by chance.
    edge = 0.0 if computed else EDGE
    edges = np.array([float(np.quantile(block, edge)) for block in blocks])
    spread = float(np.quantile(np.abs(rest), 0.975))
    if spread < max(LITTLE_S, LITTLE * period):
        return None
    away = np.arange(len(edges)) - (len(edges) - 1) / 2.0
    edges = edges - edges.mean() - away * float(away @ edges) / float(away @ away)
    strayed = float(np.abs(edges).max())
    if strayed > (STEADY_POLLED if polled else STEADY) * period:
        return None
    if polled or computed or (strayed < 0.5 * spread and _is_late(rest)):
        return Receipt(spread, period, polled, strayed)
    return None


def _poll_interval(steps: FloatArray) -> float:
    """Return the interval of which steps are several multiples, not that of samples; else 0."""
    long = steps[steps > SHORTEST_POLL_S / 2.0]
    if len(long) < len(steps) / 50:
        return 0.0
    shortest = float(np.quantile(long, 0.02))
    near = long[np.abs(long - shortest) < 0.1 * shortest]
    for parts in (1, 2, 3, 4):
        interval = float(np.median(near)) / parts
        if interval < SHORTEST_POLL_S:
            return 0.0
        multiples = np.round(steps / interval)
        if (np.abs(steps / interval - multiples) < ON_GRID).mean() > NEARLY_ALL:
            shares = np.unique(multiples, return_counts=True)[1] / len(steps)
            return interval if np.count_nonzero(shares > SOME) > 1 else 0.0
    return 0.0


def _is_computed(steps: FloatArray) -> bool:
    """Whether most steps are the same: chunks were computed back from one stamp."""
    return float((np.abs(steps - np.median(steps)) < EQUAL_S).mean()) > SAME


def _is_late(rest: FloatArray) -> bool:
    """Whether stamps are late by delays of their own, behind a lower edge."""
    least, low, middle, high = np.quantile(rest, (0.005, 0.05, 0.5, 0.95))
    some = rest[:SLICE] - rest[:SLICE].mean()
    alike = float(some[1:] @ some[:-1]) / float(some @ some)
    skewed = high - middle > SKEWED * (middle - low)
    behind_an_edge = len(rest) >= MANY and low - least < HARD * (middle - low)
    return bool(skewed or behind_an_edge) and alike < NEW
