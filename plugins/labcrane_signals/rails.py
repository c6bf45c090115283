"""Flat lines and rails of any sampled signal: values that stand still."""

import numpy as np

from labcrane import FloatArray
from labcrane_signals.windows import BoolArray

CLIPPED = 0.08
"""Fraction of a window at its own largest or smallest value: a signal turns there, it does not
stay, unless something holds it."""

FEWEST = 5
"""Samples that must be there: at low rates a signal may turn on a few of them."""

FEWEST_LEVELS = 12
"""Values that a signal must take: of fewer, each is an end."""


class Rails:
    """Tells a signal that is held at the converter's limits from one that has died within them.

    Parameters
    ----------
    channels
        How many there are.
    """

    def __init__(self, channels: int) -> None:
        self._lowest = np.full(channels, np.inf)
        self._highest = np.full(channels, -np.inf)

    def evaluate(self, window: FloatArray) -> tuple[BoolArray, BoolArray]:
        """Return which channels stand still, and which are held at a limit.

        Parameters
        ----------
        window
            Shape ``(n, n_channels)``, finite.

        Returns
        -------
        tuple
            Each of shape ``(n_channels,)``. What stands still at the end of all it has shown is at
            a limit.
        """
        low, high = window.min(axis=0), window.max(axis=0)
        still = low == high
        least = max(CLIPPED, FEWEST / len(window))
        at_low = (window == low).mean(axis=0) >= least
        at_high = (window == high).mean(axis=0) >= least
        known = np.isfinite(self._lowest)
        beyond = known & ((low >= self._highest) | (high <= self._lowest))
        clipped = ~still & (at_low | at_high)
        for channel in np.flatnonzero(clipped):
            clipped[channel] = _held(window[:, channel], least)
        sound = ~still & ~clipped
        self._lowest[sound] = np.minimum(self._lowest, low)[sound]
        self._highest[sound] = np.maximum(self._highest, high)[sound]
        return still & ~beyond, clipped | (still & beyond)


def _held(signal: FloatArray, least: float) -> bool:
    """Whether a signal stays at an end far more often than on the level next to it.

    A coarse converter has few levels, and a slow signal crosses each of them alike.
    """
    _, counts = np.unique(signal, return_counts=True)
    if len(counts) < FEWEST_LEVELS:
        return False
    ends = ((counts[0], counts[1]), (counts[-1], counts[-2]))
    return any(end >= least * len(signal) and end >= 3 * next_to for end, next_to in ends)
