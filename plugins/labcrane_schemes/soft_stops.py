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

    Attributes
    ----------
    width
        The same, no less than rounding.
    nothing_lost
        The factors of joints that are far from their limits.
    """

    def __init__(self, machine: Machine, width: float) -> None:
        self.width = max(width, 1e-9)  # no width is a wall, not a division by zero
        self._limits = machine.limits
        self._free = tuple(
            (joint, low + self.width, high - self.width)
            for joint, (low, high) in enumerate(machine.limits)
        )
        self.nothing_lost = (1.0,) * len(machine.limits)

    def free(self, angles: Sequence[float]) -> bool:
        """Say whether every joint is far from its limits, so that every factor is 1."""
        for joint, lowest, highest in self._free:  # noqa: SIM110 - all() costs three times as much
            if not lowest < angles[joint] < highest:
                return False
        return True

    def factors(self, angles: Sequence[float], speeds: Sequence[float]) -> Sequence[float]:
        """Return what is left of each joint's speed, in [0, 1]."""
        if self.free(angles):
            return self.nothing_lost
        pairs = zip(angles, speeds, strict=True)
        return [self.factor(joint, angle, speed) for joint, (angle, speed) in enumerate(pairs)]

    def factor(self, joint: int, angle: float, speed: float) -> float:
        """Return 1 far from the limit ahead, falling to 0 at it; leaving a limit is free."""
        if speed == 0.0:
            return 1.0
        lowest, highest = self._limits[joint]
        room = highest - angle if speed > 0.0 else angle - lowest
        if room >= self.width:
            return 1.0
        return room / self.width if room > 0.0 else 0.0


def soft_stops(machine: Machine, width_deg: float) -> SoftStops:
    """Return the soft stops of a machine, ``width_deg`` degrees wide."""
    return SoftStops(machine, math.radians(width_deg))
