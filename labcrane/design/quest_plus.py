"""QUEST+: the level with the highest expected information on the threshold (Watson 2017).

The existing library takes seconds to load and two ticks of a loop for a choice, so this is an
implementation of our own. The tests compare the two.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from labcrane.protocol.tracks import THRESHOLDS, QuestPlus
from labcrane.types import FloatArray

SURE = 1e-12
"""Limit of certainty: an impossible answer must not leave a posterior of zeros."""

DIGITS = 9
"""Precision of comparing entropies, so that sums in another order choose the same level."""


GRIDS = 1024
"""Number of cached grids, some kB each: more than any study's tracks, so none is made twice."""


@dataclass(frozen=True, slots=True)
class Posterior:
    """The estimate of a participant's threshold.

    Attributes
    ----------
    best
        Number of the level with the highest expected information.
    mean, sd
        Of the threshold, in the levels' unit.
    """

    best: int
    mean: float
    sd: float


class Grid:
    """Every threshold with every spread, and the probabilities of each at each level.

    Parameters
    ----------
    levels
        Difficulty of each level, shape ``(n_levels,)``.
    """

    def __init__(self, settings: QuestPlus, levels: Sequence[float]) -> None:
        axis = np.linspace(min(levels), max(levels), THRESHOLDS)
        self.thresholds = np.repeat(axis, len(settings.spreads))
        spreads = np.tile(settings.spreads, THRESHOLDS)
        normal = [
            [0.5 * math.erfc((level - t) / (s * math.sqrt(2.0))) for t, s in self._pairs(spreads)]
            for level in levels
        ]
        right = settings.guess + (1.0 - settings.guess - settings.lapse) * np.array(normal)
        self._right = np.clip(right, SURE, 1.0 - SURE)
        self._wrong = 1.0 - self._right
        self._logs = np.log(self._right), np.log(self._wrong)

    def _pairs(self, spreads: FloatArray) -> list[tuple[float, float]]:
        return list(zip(self.thresholds.tolist(), spreads.tolist(), strict=True))

    def posterior(self, successes: FloatArray, failures: FloatArray) -> Posterior:
        """Return the estimate after numbers of successes and failures at each level.

        Parameters
        ----------
        successes, failures
            Shape ``(n_levels,)``.
        """
        log_right, log_wrong = self._logs
        likelihood = successes @ log_right + failures @ log_wrong
        known = np.exp(likelihood - likelihood.max())
        known /= known.sum()
        mean = float(known @ self.thresholds)
        sd = math.sqrt(float(known @ (self.thresholds - mean) ** 2))
        surprise = known * np.log(np.maximum(known, np.finfo(float).tiny))
        expected = 0.0
        for chance, logs in ((self._right, log_right), (self._wrong, log_wrong)):
            total = chance @ known  # of this answer at each level
            told = (chance * logs) @ known + chance @ surprise
            expected = expected + total * np.log(total) - told
        return Posterior(int(np.argmin(np.round(expected, DIGITS))), mean, sd)


@lru_cache(maxsize=GRIDS)
def grid(settings: QuestPlus, levels: tuple[float, ...]) -> Grid:
    """Return a grid, made once."""
    return Grid(settings, levels)
