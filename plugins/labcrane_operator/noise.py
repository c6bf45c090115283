"""Everything random in a simulated operator, from the trial's seed."""

import math

import numpy as np

from labcrane_operator.sub_movement import Point

BLOCK = 512
"""Ticks of motor noise drawn at once; one call a tick would cost more than the plan."""

SIDE_SHARE = 0.5
"""Scatter of a movement's end across the way, over that along it."""


class Noise:
    """Motor noise and scatter of one trial.

    Motor noise is a first-order autoregression with unit variance, exact at the tick rate.

    Parameters
    ----------
    seed
        The trial's seed.
    share
        How much of a tick's motor noise is left on the next.
    """

    def __init__(self, seed: int, share: float) -> None:
        self._once, self._motor, self._attention = (
            np.random.default_rng([seed, part]) for part in range(3)
        )  # apart, so that a longer movement does not shift where the next one ends
        self._share = share
        self._fresh = math.sqrt(1.0 - share * share)
        self._values: Point = (0.0, 0.0, 0.0)
        self._drawn: list[list[float]] = []

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

    @property
    def share(self) -> tuple[float, float]:
        """How much of a tick's motor noise is left on the next, and how much is fresh."""
        return self._share, self._fresh

    def drawn(self) -> tuple[Point, list[list[float]]]:
        """Return the last tick's motor noise, and what was drawn for the next, the last first."""
        return self._values, self._drawn

    def go_on(self, values: Point, left: int) -> None:
        """Go on from a tick's motor noise, with as much as is left of what was drawn."""
        self._values = values
        del self._drawn[left:]

    def motor(self) -> Point:
        """Return this tick's motor noise along x, y and z, of unit variance."""
        if not self._drawn:
            self._drawn = self._motor.standard_normal((BLOCK, 3)).tolist()
        share, fresh = self._share, self._fresh
        x, y, z = self._values
        a, b, c = self._drawn.pop()
        self._values = (share * x + fresh * a, share * y + fresh * b, share * z + fresh * c)
        return self._values
