"""Shifts of a regular stream's stamps: its sampler paused, or a buffer on the way grew or shrank.

Nothing in the stamps tells one from the other, so that the uncertainty holds both. What is shifted
by little is taken for delayed, since few samplers pause so briefly and none goes back.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from labcrane.types import FloatArray

LEAST_S, MOST_S = 2e-3, 0.5
"""Less is noise; for longer no buffer grows at once: that is a pause."""

DELAY_S = 0.25
"""What is shifted by less was delayed rather than taken later."""

PART = 0.25
"""A shift is by more than this part of a period."""

BROKEN = 0.01
"""What is lost shifts stamps by whole periods, and no further from them than this."""

ALONE = 10
"""So many steps before and after a shift are as usual."""

SEVERAL = 2
USUAL = 0.1
MOST = 20
"""Where there are more, the sampler is uneven."""


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

    def late(self, count: int, most: float = MOST_S) -> FloatArray:
        """Return by how much stamps may be late, beyond the soonest, shape ``(count,)``.

        Shifts by more than ``most`` seconds are left out.
        """
        level = np.zeros(count)
        for at, by in zip(self.at, self.by_s, strict=True):
            if abs(by) < most:
                level[at:] += by
        return np.asarray(level - level.min(initial=0.0))

    @property
    def again_and_again(self) -> bool:
        """Whether a delay may grow slowly and pass at once: shifts do not add up then."""
        return len(self.by_s) >= SEVERAL and bool((self.by_s < 0.0).all())


def find(steps: FloatArray, counts: FloatArray, usual: FloatArray, *, counted: bool) -> Shifts:
    """Return the shifts of stamps that are exact otherwise.

    Parameters
    ----------
    steps, counts
        From each sample to the next: in seconds, and by the source's counter; one if it has none.
    usual
        The period around each step, in seconds.
    counted
        Whether the source has a counter.
    """
    by = steps - counts * usual
    size = np.abs(by)
    scatter = 1.4826 * float(np.median(size))
    least = np.maximum(np.maximum(LEAST_S, PART * usual), 8.0 * scatter)
    chosen = (size > least) & (size < MOST_S)
    if not counted:
        parts = by / usual
        broken = np.abs(parts - np.round(parts)) > np.maximum(BROKEN, 6.0 * scatter / usual)
        chosen &= broken | (by < 0.0)
    found = [
        int(k)
        for k in np.flatnonzero(chosen)
        if ALONE <= k < len(steps) - ALONE
        and max(size[k - ALONE : k].max(), size[k + 1 : k + 1 + ALONE].max())
        < USUAL * max(float(size[k]), float(usual[k]))
    ]
    if len(found) > MOST:
        found = []
    at = np.array(found, dtype=np.intp)
    return Shifts(at + 1, by[at])
