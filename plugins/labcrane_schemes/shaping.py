"""Shaping of a stick's deflection: dead zone, then a cubic."""

import math

ROUNDING = 1e-16
"""Cubic weight that is lost in rounding, and whose root would overflow."""


class Shaping:
    """A dead zone rescaled from its edge, and ``(1 - expo) x + expo x³``.

    Parameters
    ----------
    dead_zone
        Deflection in [0, 1) below which nothing is asked for.
    expo
        Share of the cube, in [0, 1].
    """

    def __init__(self, dead_zone: float, expo: float) -> None:
        self._edge = dead_zone
        self._rest = 1.0 - dead_zone
        self._expo = expo
        self._linear = 1.0 - expo
        self._straight = expo < ROUNDING
        cubic = not self._straight and self._linear > 0.0
        self._stretch = 2.0 * math.sqrt(self._linear / (3.0 * expo)) if cubic else 0.0
        self._steepness = 3.0 / (self._linear * self._stretch) if cubic else 0.0

    @property
    def numbers(self) -> tuple[float, ...]:
        """What a compiled kernel shapes with."""
        straight = float(self._straight)
        curve = (self._linear, self._expo, self._stretch, self._steepness, straight)
        return (self._edge, self._rest, *curve)

    def shape(self, push: float) -> float:
        """Return the share of full speed, in [-1, 1], that a deflection in [-1, 1] asks for."""
        beyond = abs(push) - self._edge
        if beyond <= 0.0:
            return 0.0
        x = beyond / self._rest
        return math.copysign(x * (self._linear + self._expo * x * x), push)

    def unshape(self, share: float) -> float:
        """Return the deflection that asks for a share of full speed, both in [-1, 1]."""
        if share == 0.0:
            return 0.0
        size = abs(share)
        x = size if size < 1.0 else 1.0
        if self._stretch > 0.0:  # the one real root, after Cardano in its hyperbolic form
            x = self._stretch * math.sinh(math.asinh(self._steepness * x) / 3.0)
        elif not self._straight:
            x = math.cbrt(x)
        push = self._edge + self._rest * x
        return math.copysign(push if push < 1.0 else 1.0, share)
