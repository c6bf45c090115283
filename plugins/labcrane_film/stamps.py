"""Times of frames on the session's clock, and what is known of them."""

import math
import time
from collections.abc import Callable

CLOCKS: tuple[Callable[[], float], ...] = (time.time, time.monotonic)
"""Clocks that drivers stamp with: the computer's date, and the time since it was started."""

RESOLUTION_S = max(time.get_clock_info(each).resolution for each in ("time", "monotonic"))
"""Some systems move these clocks on by steps of 16 ms."""

OLDEST_S = 5.0
"""A frame does not come later than this after its capture: else its stamp is of another clock."""

TRIES = 3
DRIFT = 1e-4
"""Clocks of devices drift by less than this against the computer's."""


class StampClock:
    """The clock of a device's timestamps, recognised from them."""

    def __init__(self) -> None:
        self._clock: Callable[[], float] | None = None
        self._offset = 0.0

    @property
    def known(self) -> bool:
        """Whether it was recognised."""
        return self._clock is not None

    def time_of(self, stamp: float, arrival: float) -> tuple[float, float] | None:
        """Return when a stamp was on the session's clock, and the uncertainty, in seconds.

        None where the stamp is of no clock that is known. Both clocks are read at each frame, so
        that a date that is set or slewed moves no time unnoticed: the uncertainty includes it.
        """
        for clock in CLOCKS if self._clock is None else (self._clock,):
            offset, error = _relation(clock)
            if -error <= arrival - (stamp + offset) <= OLDEST_S:
                moved = 0.0 if self._clock is None else abs(offset - self._offset)
                self._clock, self._offset = clock, offset
                return stamp + offset, error + moved
        return None


def _relation(clock: Callable[[], float]) -> tuple[float, float]:
    """Return the session's clock minus another one, and the uncertainty, in seconds."""
    found = []
    for _ in range(TRIES):
        before = time.perf_counter()
        there = clock()
        after = time.perf_counter()
        found.append(((after - before) / 2, (before + after) / 2 - there))
    error, offset = min(found)
    return offset, error + RESOLUTION_S


class ArrivalSpread:
    """How late frames arrive, beyond the soonest, by stamps of an unknown clock.

    A delay that grows and stays is not forgotten. What the device's clock may have drifted since
    the soonest is added.
    """

    def __init__(self) -> None:
        self._soonest = math.inf
        self._came = 0.0

    def of(self, pts: float, arrival: float, period: float) -> float:
        """Return by how much an arrival may be off, in seconds: at least a frame's duration."""
        late = arrival - pts
        if late < self._soonest:
            self._soonest, self._came = late, arrival
        return max(late - self._soonest + DRIFT * (arrival - self._came), period)
