"""Shifts of a regular stream's stamps: its sampler paused, or a buffer on the way grew or shrank.

Nothing in the stamps tells one from the other, so that the uncertainty holds both. Only what was
stamped before a buffer shrank is known to have been late, since no sampler goes back.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from labcrane.types import FloatArray

LEAST_S, MOST_S = 2e-3, 0.5
"""Less is noise; no buffer on the way holds more, however often it grows: that is a pause."""

PART = 0.25
"""A shift is by more than this part of a period."""

ALONE = 10
"""So many steps before and after a shift are as usual."""

SEVERAL = 2
USUAL = 0.1


@dataclass(frozen=True, slots=True)
class Shifts:
    """Shifts of stamps.

    Attributes
    ----------
    at
        The first sample behind each, shape ``(n_shifts,)``.
    by_s
        Seconds by which stamps are later from then on, shape ``(n_shifts,)``.
    """

    at: npt.NDArray[np.intp]
    by_s: FloatArray

    def late(self, count: int) -> FloatArray:
        """Return by how much stamps may be late, beyond the soonest, shape ``(count,)``.

        Each shift to later may have been a delay, or a pause: either may hold for what was before
        or is behind it. Shifts add up, to no more than a buffer holds.
        """
        by, sooner = np.zeros(count), np.zeros(count)
        np.add.at(by, self.at, self.by_s)
        np.add.at(sooner, self.at, np.maximum(-self.by_s, 0.0))
        level = np.cumsum(by)
        delays = level - np.minimum(np.minimum.accumulate(level), 0.0)
        pauses = sooner.sum() - np.cumsum(sooner)
        return np.asarray(np.minimum(np.maximum(delays, pauses), MOST_S))

    def surely(self, count: int) -> FloatArray:
        """Return by how much stamps are late for certain, shape ``(count,)``.

        No sampler goes back: what was stamped before a shift to sooner was late by that, as far
        back as a shift to later may have begun it.
        """
        level = np.zeros(count)
        if self.again_and_again:
            return level
        late, stop = 0.0, count
        for at, by in zip(self.at[::-1], self.by_s[::-1], strict=True):
            level[at:stop] = late
            late, stop = min(max(late - float(by), 0.0), MOST_S), int(at)
        level[:stop] = late
        return level

    @property
    def again_and_again(self) -> bool:
        """Whether a delay may grow slowly and pass at once: shifts do not add up then."""
        return len(self.by_s) >= SEVERAL and bool((self.by_s < 0.0).all())


def find(
    steps: FloatArray, counts: FloatArray, usual: FloatArray, longer: npt.NDArray[np.bool_]
) -> Shifts:
    """Return the shifts of stamps that are exact otherwise.

    Parameters
    ----------
    steps, counts
        From each sample to the next: in seconds, and by the source's counter; one if it has none.
    usual
        The period around each step, in seconds.
    longer
        Which steps may be shifts to later: those in which nothing was lost.
    """
    by = steps - counts * usual
    size = np.abs(by)
    scatter = 1.4826 * float(np.median(size))
    least = np.maximum(np.maximum(LEAST_S, PART * usual), 8.0 * scatter)
    chosen = (size > least) & (size < MOST_S) & (longer | (by < 0.0))
    found = [
        int(k)
        for k in np.flatnonzero(chosen)
        if ALONE <= k < len(steps) - ALONE
        and max(size[k - ALONE : k].max(), size[k + 1 : k + 1 + ALONE].max())
        < USUAL * max(float(size[k]), float(usual[k]))
    ]
    at = np.array(found, dtype=np.intp)
    return Shifts(at + 1, by[at])
