"""Steady sampler: how a regular stream's own timestamps show that their clock was turned.

A sampler with a crystal of its own goes on as before while a daemon turns the clock of its
computer: every stamp then shows the turn, however long the probes were held up meanwhile.
"""

from dataclasses import dataclass

import numpy as np

from labcrane.types import FloatArray

FEW = 100
BLOCK_S = 0.1
LEAST = 10
"""Samples of a block, at least."""

WHOLE = 0.25
LONGEST = 40.0
"""Periods without a sample that can be counted however fast a clock is turned."""

NOISE_S = 2e-5


@dataclass(frozen=True, slots=True)
class SteadySampler:
    """How far the sampler's count is ahead of the clock that stamps, in seconds.

    Attributes
    ----------
    at
        Times of the clock, ascending, shape ``(n,)``.
    ahead
        Periods that were counted there, minus the time of the clock; it begins with 0.
    noise_s
        By how much stamps scatter in that, a standard deviation.
    """

    at: FloatArray
    ahead: FloatArray
    noise_s: float

    @classmethod
    def of(cls, stamps: FloatArray) -> "SteadySampler | None":
        """Return the sampler behind stamps; None if they scatter, or its count is not sure."""
        steps = np.diff(stamps)
        if len(stamps) < FEW or not (steps > 0.0).all():
            return None
        period = float(np.median(steps))
        counts = np.round(steps / period)
        if (np.abs(steps / period - counts) > WHOLE).any() or counts.max() > LONGEST:
            return None
        ahead = np.r_[0.0, np.cumsum(counts * period - steps)]
        size = max(LEAST, round(BLOCK_S / period))
        whole = len(stamps) // size * size
        at, level = (np.median(each[:whole].reshape(-1, size), axis=1) for each in (stamps, ahead))
        if len(at) < LEAST:
            return None
        bends = np.abs(np.diff(level, 2))
        noise = 1.4826 * float(np.median(bends)) / np.sqrt(6.0)
        return cls(at, level - level[0], noise) if noise < NOISE_S else None

    def __call__(self, times: FloatArray) -> FloatArray:
        """Return what the sampler's count reads at times of the clock, shape ``(n,)``."""
        return np.asarray(times + np.interp(times, self.at, self.ahead))
