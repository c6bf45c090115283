"""One movement of the tip: what was seen of it so far, and its measures when it is over."""

import math
from array import array
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np

from labcrane import FloatArray
from labcrane.core import Value
from labcrane_aiming import law
from labcrane_aiming.pairs import Point
from labcrane_aiming.settings import AimingSettings

ROUNDING_S = 1e-9
"""Elapsed times are sums of whole ticks."""

Numbers: TypeAlias = "array[float]"
"""A few in every tick; a list of them takes four times the memory."""


def none_yet() -> Numbers:
    """Return numbers, to be appended to."""
    return array("d")


@dataclass
class AimedMovement:
    """The path of the tip, tick by tick.

    Attributes
    ----------
    start, target
        Centres of the circle the movement comes from and of the one it goes to, in metres.
    elapsed, due
        Trial time and time on the run's clock of every tick, in seconds.
    speed, position, distance
        Tip speed in m/s, position in m (x, y and z of a tick one after the other), and distance to
        the target's centre in m.
    inside, entered
        Whether the tip is in the target now, and whether it came into it in this very tick.
    fast_since, onset
        Trial time since which the tip has been faster than the onset speed, and at which the
        movement began, in s; NaN for not yet.
    hands_off, command_onset, reaction_time
        Whether there has been a tick without a command; and trial times in s of the first command,
        and of the first one after such a tick; NaN for not yet.
    """

    settings: AimingSettings
    start: Point
    target: Point
    elapsed: Numbers = field(default_factory=none_yet)
    due: Numbers = field(default_factory=none_yet)
    speed: Numbers = field(default_factory=none_yet)
    position: Numbers = field(default_factory=none_yet)
    distance: Numbers = field(default_factory=none_yet)
    entries: int = 0
    first_entry: float = math.nan
    fast_since: float = math.nan
    onset: float = math.nan
    hands_off: bool = False
    command_onset: float = math.nan
    reaction_time: float = math.nan
    rest_since: float = math.nan
    ticks: int = 0
    inside: bool = False
    entered: bool = False

    def see(
        self, elapsed: float, due: float, tip: Sequence[float], velocity: Sequence[float]
    ) -> None:
        """Take one tick."""
        settings = self.settings
        (x, y, z), (tx, ty, tz) = tip, self.target
        speed, distance = law.size(*velocity), law.size(x - tx, y - ty, z - tz)
        inside = distance <= settings.width / 2
        self.entered = inside and not self.inside
        self.inside = inside
        rests = speed < settings.rest_speed and (inside or settings.end != "rest_inside")
        self.rest_since = law.since(self.rest_since, elapsed, rests)
        self.ticks += 1
        self.elapsed.append(elapsed)
        self.due.append(due)
        self.speed.append(speed)
        self.position.extend(tip)
        self.distance.append(distance)
        if not self.begun:
            self._look_for_onset(elapsed, speed, distance)

    def _look_for_onset(self, elapsed: float, speed: float, distance: float) -> None:
        """Take one tick more into account."""
        settings = self.settings
        self.fast_since = law.since(self.fast_since, elapsed, speed > settings.onset_speed)
        hold, half = settings.onset_hold_s - ROUNDING_S, settings.width / 2
        nearer = self.distance[0] - distance
        if law.begins(self.fast_since, elapsed, hold, self.elapsed[0], nearer, half):
            self.onset = self.fast_since

    def command(self, elapsed: float, *, given: bool) -> None:
        """Take whether there is a command in a tick: a stick beyond its dead zone."""
        if not given:
            self.hands_off = True
            return
        if math.isnan(self.command_onset):
            self.command_onset = elapsed
        if self.hands_off and math.isnan(self.reaction_time):
            self.reaction_time = elapsed

    def go_on(
        self, elapsed: FloatArray, due: FloatArray, tip: FloatArray, velocity: FloatArray
    ) -> None:
        """Add many ticks, as :meth:`see` adds one; the caller tracks entries, rests and speeds.

        Parameters
        ----------
        elapsed, due
            In s, shape ``(n,)``.
        tip, velocity
            In m and m/s, shape ``(n, 3)``.
        """
        away = tip - np.array(self.target)
        self.ticks += len(elapsed)
        self.elapsed.frombytes(elapsed.tobytes())
        self.due.frombytes(due.tobytes())
        self.speed.frombytes(_length(velocity).tobytes())
        self.position.frombytes(np.ascontiguousarray(tip).tobytes())
        self.distance.frombytes(_length(away).tobytes())

    @property
    def shown(self) -> FloatArray:
        """The task's signals: target, radius and where it comes from, in metres, shape ``(7,)``."""
        return np.array([*self.target, self.settings.width / 2, *self.start])

    @property
    def rested(self) -> bool:
        """Whether the tip has been at rest, where it must be, for long enough."""
        return self.elapsed[-1] - self.rest_since >= self.settings.rest_s - ROUNDING_S

    @property
    def done(self) -> float:
        """Fraction of the way from circle to circle that the tip has made along the task axis."""
        return law.done(self.position[-3:], self.target, self.start)

    @property
    def begun(self) -> bool:
        """Whether the movement has begun, and is not only how the one before it runs out."""
        return not math.isnan(self.onset)

    def tick_at(self, elapsed: float) -> int:
        """Return the tick at a trial time."""
        return int(np.searchsorted(self.elapsed, elapsed - ROUNDING_S))

    def measures(self, end: int | None) -> dict[str, Value]:
        """Return the results; ``end`` is the tick of the movement's offset.

        Without an offset (a time-out), the errors are those of the last tick, and the times that
        end with the offset are NaN. They are also NaN without an onset, because there was no
        movement.
        """
        settings = self.settings
        last = len(self.elapsed) - 1 if end is None else end
        began = self.onset
        positions = np.array(self.position).reshape(-1, 3)
        path = positions[self.tick_at(began) if self.begun else 0 : last + 1]
        along, across = self._error(positions[last])
        bounded = settings.end == "rest_inside" and end is not None
        return {
            "reaction_time": self.reaction_time,
            "command_onset": self.command_onset,
            "movement_onset": began,
            "onset_speed": settings.onset_speed,
            "onset_hold": settings.onset_hold_s,
            "movement_time": math.nan if end is None else self.elapsed[end] - began,
            "onset_to_rest": math.nan if end is None else self._rests_after(began),
            "at_rest": 0.0 if math.isnan(self.rest_since) else self.elapsed[-1] - self.rest_since,
            "circle_to_circle": self.elapsed[end] if end is not None and self.begun else math.nan,
            "between_circles": self.first_entry - self._left(),
            "first_entry": self.first_entry,
            "entries": self.entries,
            "error": self.distance[last],
            "error_along": along,
            "error_across": across,
            "error_bound": settings.width / 2 if bounded else math.nan,
            "path_length": float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum()),
            "peak_speed": max(self.speed),
        }

    def _rests_after(self, onset: float) -> float:
        """Return how long after the onset the rest began that the end of the trial found, in s.

        A rest is what it is for the rest rules, and by the end as long as they ask for; NaN while
        the tip moved, or had not rested for long enough.
        """
        known = self.rested and self.rest_since >= onset
        return self.rest_since - onset if known else math.nan

    def _left(self) -> float:
        """Return when the tip left the circle it came from, in seconds since the trial's start.

        The last time before it came into the other; NaN when it began outside, or never left.
        """
        away = np.linalg.norm(np.reshape(self.position, (-1, 3)) - self.start, axis=1)
        before = np.asarray(self.elapsed) < self.first_entry
        inside = (away <= self.settings.width / 2) & before
        if not inside[0]:
            return math.nan
        return self.elapsed[int(np.flatnonzero(inside)[-1]) + 1]

    def _error(self, tip: FloatArray) -> tuple[float, float]:
        axis: FloatArray = np.subtract(self.target, self.start)
        axis = axis / np.linalg.norm(axis)
        miss = np.subtract(tip, self.target)
        along = float(miss @ axis)
        return along, float(np.linalg.norm(miss - along * axis))


def _length(vectors: FloatArray) -> FloatArray:
    """Return the lengths of vectors, shape ``(n, 3)``, to the same bits as in a tick."""
    x, y, z = vectors.T
    lengths: FloatArray = np.sqrt(x * x + y * y + z * z)
    return lengths
