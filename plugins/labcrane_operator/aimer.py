"""Aiming of an operator: aim, move, look, correct."""

import math
from collections.abc import Sequence
from enum import Enum, auto

from labcrane_operator.noise import Noise
from labcrane_operator.settings import OperatorSettings
from labcrane_operator.sub_movement import Point, SubMovement, fitts_duration

STILL = (0.0, 0.0, 0.0)


class Doing(Enum):
    """What the operator is at."""

    WAITING = auto()  # for a target
    REACTING = auto()  # to a target just seen
    MOVING = auto()  # along a plan
    LOOKING = auto()  # at where the plan ended
    HOLDING = auto()  # at rest inside the target


# Python 3.11 takes long to find an attribute of an enumeration; 3.12 does not.
WAITING, REACTING, MOVING, LOOKING, HOLDING = Doing


class Aimer:
    """One trial's aimed movements.

    A primary movement of least jerk, as long as Fitts' law says and scattered at its end, is
    followed by corrective ones (after Meyer et al. 1988). The tip is steered along the plan with
    a correction towards it; a plan that has run ahead of the machine waits for it.

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
    """

    def __init__(
        self, settings: OperatorSettings, noise: Noise, slowness: float, dt: float
    ) -> None:
        self._settings = settings
        self._noise = noise
        self._slowness = slowness
        self._dt = dt
        self._doing = WAITING
        self._target: Point | None = None
        self._plan: SubMovement | None = None
        self._time = 0.0
        self._wait = 0.0
        self._press = 0.0

    @property
    def pressing(self) -> bool:
        """Whether the trigger is pressed now."""
        return self._doing is HOLDING and self._press > 0.0

    def rest(self) -> None:
        """There is no target: forget the last one."""
        self._doing, self._target = WAITING, None

    def move(self, tip: Point, speed: float, target: Point, radius: float) -> Point:
        """Return the tip velocity in m/s that the hands ask for now.

        Called once a tick that is not paused. ``tip`` and ``target`` are positions in m,
        ``speed`` is the tip's in m/s, ``radius`` the target's in m.
        """
        if target != self._target:
            self._see(target)
        if self._doing is MOVING:
            return self._follow(tip)
        self._wait -= self._dt
        ex, ey, ez = tip[0] - target[0], tip[1] - target[1], tip[2] - target[2]
        # A root of squares, not dist: that rounds otherwise since Python 3.12.
        off = math.sqrt(ex * ex + ey * ey + ez * ez)
        inside = off <= self._settings.inside * radius
        if self._doing is HOLDING:
            self._press -= self._dt
            if inside:
                return STILL
            self._aim(tip, target, radius)
        elif self._doing is REACTING:
            if self._wait > 0.0:
                return STILL
            self._aim(tip, target, radius)
        elif self._doing is LOOKING and self._wait <= 0.0:
            if not inside:
                self._aim(tip, target, radius)
            elif speed < self._settings.still_m_s:
                self._doing = HOLDING
                return STILL
        return self._follow(tip)

    def is_at(self, target: Point) -> bool:
        """Whether this is the target that was seen last."""
        return target == self._target

    def numbers(self) -> list[float]:
        """Return what a compiled kernel goes on from; :mod:`.compiled` says what is where."""
        values, drawn = self._noise.drawn()
        now = (self._doing.value, self._time, self._wait, self._press, *values, len(drawn))
        plan = self._plan
        if plan is None:
            return [*now, *(0.0,) * 11]
        return [*now, 1.0, plan.duration, *plan.start, *plan.way, *plan.end]

    @property
    def drawn(self) -> list[list[float]]:
        """Motor noise that was drawn for the next ticks, the last first."""
        return self._noise.drawn()[1]

    def constants(self) -> tuple[float, ...]:
        """Return what of it does not change in a trial."""
        settings = self._settings
        still = settings.still_m_s
        return (
            self._dt, settings.gain_per_s, still, still**2, settings.motor_noise,
            settings.patience_m, settings.look_s, settings.inside, *self._noise.share,
        )  # fmt: skip

    def go_on(self, numbers: Sequence[float]) -> None:
        """Go on from where a compiled kernel came to."""
        doing, self._time, self._wait, self._press, x, y, z, left = numbers
        self._doing = Doing(int(doing))
        self._noise.go_on((x, y, z), int(left))

    def _see(self, target: Point) -> None:
        """Turn to a new target."""
        settings = self._settings
        self._doing, self._target = REACTING, target
        self._wait = self._noise.reaction(settings.reaction_s, settings.reaction_sd)
        if self._noise.lapse(settings.lapse_rate):
            self._wait += settings.lapse_s
        self._press = settings.press_s

    def _aim(self, tip: Point, target: Point, radius: float) -> None:
        """Plan a sub-movement from where the tip is."""
        settings = self._settings
        duration = self._slowness * fitts_duration(
            settings.fitts_a_s, settings.fitts_b_s, math.dist(tip, target), 2.0 * radius
        )
        end = self._noise.scatter(tip, target, settings.endpoint_noise)
        self._plan = SubMovement(tip, end, duration)
        self._doing, self._time = MOVING, 0.0

    def _follow(self, tip: Point) -> Point:
        """Return the velocity in m/s along the plan and towards it, with the hands' noise."""
        settings, plan = self._settings, self._plan
        if plan is None:
            return STILL
        (x, y, z), (vx, vy, vz) = plan.at(self._time)
        ex, ey, ez = x - tip[0], y - tip[1], z - tip[2]
        pace = self._advance(plan, math.sqrt(ex * ex + ey * ey + ez * ez))
        gain = settings.gain_per_s
        vx, vy, vz = pace * vx + gain * ex, pace * vy + gain * ey, pace * vz + gain * ez
        if vx * vx + vy * vy + vz * vz < settings.still_m_s**2 and self._doing is LOOKING:
            return STILL
        nx, ny, nz = self._noise.motor()
        sd = settings.motor_noise
        return vx * (1.0 + sd * nx), vy * (1.0 + sd * ny), vz * (1.0 + sd * nz)

    def _advance(self, plan: SubMovement, lag: float) -> float:
        """Go on in the plan by a tick; return its pace, below 1 when the machine lags behind."""
        pace = 2.0 - 2.0 * lag / self._settings.patience_m
        pace = 1.0 if pace > 1.0 else pace if pace > 0.0 else 0.0
        if self._doing is MOVING:
            self._time += pace * self._dt
            if self._time >= plan.duration:
                self._doing, self._wait = LOOKING, self._settings.look_s
        return pace
