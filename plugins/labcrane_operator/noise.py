"""Everything random in a simulated operator, from the trial's seed."""

import math

import numpy as np

Point = tuple[float, float, float]

SIDE_SHARE = 0.5
"""Scatter of a movement's end across the way, over that along it."""


class Noise:
    """Reaction, lapse, scatter and motor noise of one trial.

    Parameters
    ----------
    seed
        The trial's seed.
    """

    def __init__(self, seed: int) -> None:
        self._once, self._motor, self._attention = (
            np.random.default_rng([seed, part]) for part in range(3)
        )  # apart, so that a longer movement does not shift where the next one ends

    def lapse(self, rate: float) -> bool:
        """Say whether attention lapses in this trial, with this probability."""
        return bool(self._attention.uniform() < rate)

    def reaction(self, median: float, spread: float) -> float:
        """Return a lognormal time in seconds."""
        return median * math.exp(spread * float(self._once.standard_normal()))

    def scatter(self, start: Point, end: Point, share: float) -> Point:
        """Return where a movement to ``end`` ends: scattered by a share of its length in m."""
        way = np.subtract(end, start)
        length = float(np.linalg.norm(way))
        draw = self._once.standard_normal(3)
        if length == 0.0:
            return end
        along = way / length
        side = draw - (draw @ along) * along
        x, y, z = (end + share * length * ((draw @ along) * along + SIDE_SHARE * side)).tolist()
        return x, y, z

    def motor(self, ticks: int) -> list[float]:
        """Return fresh noise for ticks, each along x, y and z, the last tick's first."""
        drawn: list[float] = self._motor.standard_normal(3 * ticks).tolist()
        return drawn
