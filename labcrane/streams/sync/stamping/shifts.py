"""Shifts of a regular stream's stamps: it paused, a buffer grew or shrank, a clock was set.

Nothing in the stamps tells one from the other, so that nothing is moved, and the uncertainty holds
all of them.
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

    def without_pauses(self) -> "Shifts":
        """Return those to sooner: a sampler that is declared to pause shifts stamps to later."""
        back = self.by_s < 0.0
        return Shifts(self.at[back], self.by_s[back])

    def open_s(self, count: int) -> FloatArray:
        """Return by how much stamps may be off, before and behind each shift, shape ``(count,)``.

        Which of its sides is right nothing tells. Shifts of one direction add up: those to later,
        which may be pauses, to no more than a buffer holds. A shift back may be none of them.
        """
        found = np.zeros(count)
        for by_s, most in (
            (np.maximum(self.by_s, 0.0), MOST_S),
            (np.minimum(self.by_s, 0.0), np.inf),
        ):
            by = np.zeros(count)
            np.add.at(by, self.at, np.abs(by_s))
            level = np.cumsum(by)
            found = np.maximum(found, np.minimum(np.maximum(level, level[-1] - level), most))
        return found


def find(
    by: FloatArray, usual: FloatArray, back: FloatArray, known: npt.NDArray[np.bool_]
) -> Shifts:
    """Return the shifts of stamps.

    Parameters
    ----------
    by, usual
        By how much each step is longer than it should be, and the period around it, in seconds.
    back
        By how much stamps go back in each step, and do not return, in seconds.
    known
        Which steps may be shifts by themselves: those of exact stamps in which nothing was lost.
    """
    size = np.abs(by)
    scatter = 1.4826 * float(np.median(size))
    least = np.maximum(np.maximum(LEAST_S, PART * usual), 8.0 * scatter)
    found = back > 0.0
    for k in np.flatnonzero((size > least) & (size < MOST_S) & known & ~found):
        around = np.r_[size[max(k - ALONE, 0) : k], size[k + 1 : k + 1 + ALONE]]
        near_end = not ALONE <= k < len(by) - ALONE
        found[k] = not near_end and around.max() < USUAL * max(float(size[k]), float(usual[k]))
    at = np.flatnonzero(found)
    return Shifts(at + 1, np.where(back[at] > 0.0, -back[at], by[at]))
