"""Holes between stamps of a regular stream that has no counter: lost samples, or a pause.

A step is a hole if its stamps stay late by it. What a burst behind it makes good was delayed, and
all of it is there: stamps over their span bound what can be missing.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from labcrane.streams.sync.stamping.shifts import LEAST_S, PART
from labcrane.types import FloatArray

LONGER = 0.5
"""A hole is longer than the usual step by more than this part of a period."""

SURE = 6.0
"""And by more than so many standard deviations by which steps scatter."""

ALONE, FEW = 5, 2
"""Where steps are odd again and again, those are holes that have few others among so many before
and after."""

ALWAYS_S, ALWAYS = 1.0, 20.0
"""No chunk waits for longer than both, the second in periods, unless something is wrong."""

LEVEL = 20
"""So many stamps before and after a hole tell how long it is."""

PASSING_S = 5.0
"""Delays pass within this, or within twice as many samples as are missing."""

MADE_GOOD, REST = 0.3, 0.1
"""A burst makes good more than the first part of a step, or it is not a burst; the period is not
known well enough to show that less than the second is missing."""

BROKEN = 0.01
"""What is lost shifts stamps by whole periods, and no further from them than this."""

WALK = 2e-4
"""By so much the period changes from what it is around a hole."""

TOLD = 0.25
"""Within more than this part of a period, nothing tells whole ones from others."""

MANY = 200

SLIDE, EVEN = 5e-4, 1.25
"""Polls at a sampler's own rate differ from it by no more, and miss it at intervals that are alike.
"""


@dataclass(frozen=True, slots=True)
class Holes:
    """Holes of a stream without a counter.

    Attributes
    ----------
    at
        The step that each one is, shape ``(n_holes,)``.
    periods
        By how many periods each is longer than the usual step; 0 where a burst made it good.
    broken
        Which are surely not a whole number of periods: loss is not their only cause.
    untold
        Which may be, or not: stamps scatter by too much to tell.
    usual
        The period around each, in seconds.
    """

    at: npt.NDArray[np.intp]
    periods: FloatArray
    broken: npt.NDArray[np.bool_]
    untold: npt.NDArray[np.bool_]
    usual: FloatArray

    def may_be_slips(self, count: int) -> bool:
        """Return whether nothing was lost in ``count`` steps, maybe, but polls found no sample yet.

        Those that are as fast as the sampler find none at even intervals, as its phase slides.
        """
        one = self.at[~self.broken & ~self.untold & (np.round(self.periods) == 1.0)]
        runs = np.diff(np.r_[0, one, count])
        whole = runs[1:-1].min(initial=count)
        return bool(0 < len(one) < SLIDE * count and runs.max() <= EVEN * whole)

    def pauses(self) -> "Holes":
        """Return those of a counter that are longer than by a poll that found no sample yet."""
        long = self.periods > 1.5  # noqa: PLR2004
        every = long[long]
        return Holes(self.at[long], self.periods[long], every, ~every, self.usual[long])

    def lost(self, count: int) -> FloatArray:
        """Return how many samples were lost in each step, shape ``(count,)``."""
        found = np.zeros(count)
        found[self.at] = np.where(self.broken, 0.0, np.round(self.periods))
        return found

    def beyond(self, count: int) -> FloatArray:
        """Return by how much steps are longer than what was lost in them, shape ``(count,)``.

        In seconds; none where a hole is a whole number of periods for sure.
        """
        found = np.zeros(count)
        rest = (self.periods - self.lost(count)[self.at]) * self.usual
        found[self.at] = np.where(self.broken | self.untold, rest, 0.0)
        return found


def find(
    steps: FloatArray,
    usual: FloatArray,
    scatter: float,
    grid: float,
    *,
    exact: bool,
    chunks: bool,
) -> Holes:
    """Return the holes.

    Parameters
    ----------
    steps, usual
        From each sample to the next, and what that is around it, in seconds, shape ``(n - 1,)``.
    scatter
        Of the steps, a standard deviation.
    grid
        Unit that stamps are cut to, in seconds; 0 where they are not.
    exact
        Whether nearly all steps are usual ones.
    chunks
        Whether stamps are those of chunks, which wait.
    """
    always = steps > np.maximum(ALWAYS * usual, ALWAYS_S)
    if chunks:
        chosen = always
    else:
        odd = np.maximum(LONGER * usual, SURE * scatter)
        away = steps - usual
        usual = _flowing(steps, usual, np.abs(away) <= odd) if exact else _by_spans(steps)
        away = steps - usual
        chosen = away > odd
        if not exact:
            chosen &= _alone(np.abs(away) > odd) | always
    at = np.flatnonzero(chosen)
    late = np.r_[0.0, np.cumsum(steps - usual)]
    size = np.array([_size(late, usual, at, k, scatter) for k in range(len(at))])
    periods = size / usual[at]
    doubt = (SURE * scatter * (1.0 + periods / MANY) + grid) / usual[at] + WALK * periods
    untold = (doubt > TOLD) | chunks
    broken = np.abs(periods - np.round(periods)) > np.maximum(BROKEN, doubt)
    return Holes(at, periods, broken & ~untold, untold & (periods > LONGER), usual[at])


def went_back(late: FloatArray, usual: FloatArray, typical: float, scatter: float) -> FloatArray:
    """Return by how much stamps go back in each step, and do not return, shape ``(n - 1,)``.

    In seconds: a clock was set, or a buffer shrank, and nothing tells whether stamps were right
    before or are now.

    Parameters
    ----------
    late
        By how much each step is longer than it should be, in seconds, shape ``(n - 1,)``.
    usual, typical
        The period around each, and that of all, in seconds.
    scatter
        Of the steps, a standard deviation.
    """
    least = np.maximum(np.maximum(LEAST_S, PART * usual), SURE * scatter)
    level, found = np.r_[0.0, np.cumsum(late + usual - typical)], np.zeros(len(late))
    for k in np.flatnonzero((late < -least) & _alone(np.abs(late) > least)):
        far = max(round(PASSING_S / typical), LEVEL)
        near, lasting = (
            float(np.median(level[max(k + 1 - n, 0) : k + 1]) - np.median(level[k + 1 : k + 1 + n]))
            for n in (LEVEL, far)
        )
        if max(abs(near + late[k]), abs(lasting + late[k])) < -late[k] / 2.0:
            found[k] = max(near, -float(late[k])) + SURE * scatter
    return found


def _by_spans(steps: FloatArray) -> FloatArray:
    """Return the mean of most spans of steps: the longest of those that scatter are late, too."""
    span = min(5 * LEVEL, len(steps))
    sums = np.r_[0.0, np.cumsum(steps)]
    return np.full(len(steps), float(np.median(sums[span:] - sums[:-span])) / span)


def _flowing(steps: FloatArray, usual: FloatArray, even: npt.NDArray[np.bool_]) -> FloatArray:
    """Return the mean of usual steps around each, which scatter hardly blurs."""
    blocks = np.array_split(np.arange(len(steps)), max(len(steps) // MANY, 1))
    kept = [block[even[block]] for block in blocks]
    kept = [block for block in kept if len(block) > MANY // 2]
    if not kept:
        return usual
    middle = [float(block.mean()) for block in kept]
    return np.interp(np.arange(len(steps)), middle, [float(steps[block].mean()) for block in kept])


def _alone(odd: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """Return where few other steps around are odd."""
    count = np.r_[0, np.cumsum(odd)]
    here = np.arange(len(odd))
    low, high = np.maximum(here - ALONE, 0), np.minimum(here + ALONE + 1, len(odd))
    return np.asarray(count[high] - count[low] - odd <= FEW)


def _size(
    late: FloatArray, usual: FloatArray, at: npt.NDArray[np.intp], k: int, scatter: float
) -> float:
    """Return by how many seconds stamps stay late behind a long step."""
    here, period = int(at[k]) + 1, float(usual[at[k]])
    begin = max(here - LEVEL, int(at[k - 1]) + 1 if k else 0)
    end = min(here + LEVEL, int(at[k + 1]) + 1 if k + 1 < len(at) else len(late))
    step = float(late[here] - late[here - 1])
    last = here + max(round(PASSING_S / period), int(2.0 * step / period)) + LEVEL
    remains = float(late[here:last].min() - late[begin:here].min())
    made_good = step - remains > max(MADE_GOOD * step, (LONGER + TOLD) * period, SURE * scatter)
    if made_good or remains < LONGER * period:  # or the soonest came as early
        return remains if remains > max(REST * step, 1.5 * period) else 0.0
    if scatter < BROKEN * period:
        return step
    return float(np.median(late[here:end]) - np.median(late[begin:here]))
