"""Slowing a joint to a stop before its limit, because no engine's own limit is soft."""

import math
from collections.abc import Sequence

from labcrane import Machine


class SoftStops:
    """What is left of each joint's speed near its limits.

    Parameters
    ----------
    machine
        Whose limits.
    width
        Distance from a limit in rad over which the speed falls to 0.
    """

    def __init__(self, machine: Machine, width: float) -> None:
        self._width = max(width, 1e-9)  # no width is a wall, not a division by zero
        self._limits = machine.limits
        self._free = tuple((low + self._width, high - self._width) for low, high in machine.limits)

    def free(self, angles: Sequence[float]) -> bool:
        """Say whether every joint is far from its limits, so that every factor is 1."""
        for angle, (lowest, highest) in zip(angles, self._free, strict=True):
            if not lowest < angle < highest:
                return False
        return True

    def factor(self, joint: int, angle: float, speed: float) -> float:
        """Return 1 far from the limit ahead, falling to 0 at it; leaving a limit is free."""
        if speed == 0.0:
            return 1.0
        lowest, highest = self._limits[joint]
        room = highest - angle if speed > 0.0 else angle - lowest
        if room >= self._width:
            return 1.0
        return room / self._width if room > 0.0 else 0.0


def soft_stops(machine: Machine, width_deg: float) -> SoftStops:
    """Return the soft stops of a machine, ``width_deg`` degrees wide."""
    return SoftStops(machine, math.radians(width_deg))
