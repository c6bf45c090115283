"""Actuator model between commanded and joint speed: dead time, lag and a rate limit."""

import math
from collections.abc import Sequence

from labcrane.core.cranes import law
from labcrane.machines.actuator import ACTUATOR_PRESETS, ActuatorSettings


class Actuator:
    """Dead time, then lag, then rate limit, for each joint.

    A command holds over its tick, and so does the speed that comes of it. The lag is discretised
    exactly for that: at the end of a tick the speed has moved towards the delayed command by
    ``1 - exp(-dt / lag)`` of the distance, which is the step response at that moment.

    Parameters
    ----------
    settings
        The delays.
    speeds
        Full joint speeds in rad/s, which the rate limit is a fraction of.
    dt
        Length of a tick, in seconds.
    """

    def __init__(self, settings: ActuatorSettings, speeds: Sequence[float], dt: float) -> None:
        self.ideal = settings == ACTUATOR_PRESETS["ideal"]
        self.joints = len(speeds)
        self.delay = round(settings.dead_time_s / dt)
        """Ticks before a command has any effect."""
        self.share = 1.0 - math.exp(-dt / settings.lag_s) if settings.lag_s else 1.0
        """Of the distance to the command, in a tick."""
        limit = math.inf if settings.rate_limit is None else settings.rate_limit
        self.most = [limit * speed * dt for speed in speeds]
        """Largest changes of the joints' speeds in a tick, in rad/s."""
        self.reset()

    def reset(self) -> None:
        """Forget every command: the joints are at rest."""
        self.numbers = [0.0] * (self.joints * (1 + self.delay) + 1)
        """State, also of a compiled kernel (:func:`labcrane.core.cranes.law.lag`)."""

    def follow(self, command: Sequence[float]) -> Sequence[float]:
        """Return the joint speeds in rad/s that a tick with this command leads to."""
        if self.ideal:
            return command
        law.lag(self.numbers, command, self.delay, self.share, self.most)
        return tuple(self.numbers[: self.joints])
