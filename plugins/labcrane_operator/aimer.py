"""Aiming of an operator: aim, move, look, correct."""

import math

from labcrane_operator import law
from labcrane_operator.noise import Noise, Point
from labcrane_operator.settings import OperatorSettings

STILL = (0.0, 0.0, 0.0)

STILL_M_S = 0.015
"""Tip speed that the operator treats as rest, and the smallest commanded speed: below what a crane
study counts as rest."""

PATIENCE_M = 0.6
"""Distance of the tip behind the plan at which the plan waits for the machine, in metres; it slows
down from half of it."""

PRESS_S = 0.1
"""How long a button is pressed at rest inside the target: several ticks of any loop."""


class Aimer:
    """One trial's aimed movements.

    A primary movement of least jerk, as long as Fitts' law says and scattered at its end, is
    followed by corrective ones (after Meyer et al. 1988). The tip is steered along the plan with
    a correction towards it; a plan that has run ahead of the machine waits for it. Motor noise is a
    first-order autoregression with unit variance, exact at the tick rate.

    Parameters
    ----------
    settings
        How the operator moves.
    noise
        The trial's randomness.
    slowness
        What Fitts' law is multiplied by: practice and pace.
    dt
        Seconds per tick.

    Attributes
    ----------
    own
        Its numbers; :mod:`.law` says what is where.
    """

    def __init__(
        self, settings: OperatorSettings, noise: Noise, slowness: float, dt: float
    ) -> None:
        self._settings = settings
        self._noise = noise
        self._slowness = slowness
        self._target: Point | None = None
        self.own = [0.0] * (law.DRAWN + 3 * law.BLOCK)
        self.own[law.DOING] = law.WAITING
        still, share = STILL_M_S, math.exp(-dt / settings.motor_noise_s)
        self.own[law.DT : law.LEFT_ON] = (
            dt, settings.gain_per_s, still, still**2, settings.motor_noise, PATIENCE_M,
            settings.look_s, settings.inside, share, math.sqrt(1.0 - share * share),
        )  # fmt: skip

    @property
    def pressing(self) -> bool:
        """Whether the trigger is pressed now."""
        return law.presses(self.own)

    def rest(self) -> None:
        """There is no target: forget the last one."""
        self.own[law.DOING], self._target = law.WAITING, None

    def move(self, tip: Point, speed: float, target: Point, radius: float) -> Point:
        """Return the tip velocity in m/s that the hands ask for now.

        Called once a tick that is not paused. ``tip`` and ``target`` are positions in m,
        ``speed`` is the tip's in m/s, ``radius`` the target's in m.
        """
        own = self.own
        if target != self._target:
            self._see(target)
        (x, y, z), (tx, ty, tz) = tip, target
        ex, ey, ez = x - tx, y - ty, z - tz
        # A root of squares, not dist: that rounds otherwise since Python 3.12.
        does = law.look(own, math.sqrt(ex * ex + ey * ey + ez * ez), speed, radius)
        if does == law.STANDS:
            return STILL
        if does == law.PLANS:
            self._aim(tip, target, radius)
        if own[law.LEFT] < 1.0:
            own[law.DRAWN :] = self._noise.motor(law.BLOCK)
            own[law.LEFT] = float(law.BLOCK)
        if law.follow(own, x, y, z) == law.STANDS:
            return STILL
        return own[law.ASKED], own[law.ASKED + 1], own[law.ASKED + 2]

    def is_at(self, target: Point) -> bool:
        """Whether this is the target that was seen last."""
        return target == self._target

    def _see(self, target: Point) -> None:
        """Turn to a new target."""
        settings, own = self._settings, self.own
        own[law.DOING], self._target = law.REACTING, target
        own[law.WAIT] = self._noise.reaction(settings.reaction_s, settings.reaction_sd)
        if self._noise.lapse(settings.lapse_rate):
            own[law.WAIT] += settings.lapse_s
        own[law.PRESS] = PRESS_S

    def _aim(self, tip: Point, target: Point, radius: float) -> None:
        """Plan a sub-movement from where the tip is."""
        settings = self._settings
        bits = math.log2(math.dist(tip, target) / (2.0 * radius) + 1.0)
        duration = self._slowness * (settings.fitts_a_s + settings.fitts_b_s * bits)
        end = self._noise.scatter(tip, target, settings.endpoint_noise)
        way = (end[0] - tip[0], end[1] - tip[1], end[2] - tip[2])
        self.own[law.PLANNED : law.DT] = (1.0, duration, *tip, *way, *end)
        self.own[law.DOING], self.own[law.TIME] = law.MOVING, 0.0
