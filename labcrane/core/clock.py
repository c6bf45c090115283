"""One time base for everything that is recorded.

All times are float seconds on the LSL clock. A tick's due time is computed from
the run's start, never from the previous tick, so lateness does not accumulate.
"""

import itertools
import time
from collections.abc import Iterator
from typing import NamedTuple, Protocol


class Clock(Protocol):
    """A monotonic clock that can also wait."""

    def now(self) -> float:
        """Return the current time in seconds."""
        ...

    def wait_until(self, due: float) -> None:
        """Return at ``due`` seconds, or at once when that has passed."""
        ...


class SystemClock:
    """The operating system's monotonic clock: the one liblsl reads.

    That the two agree is checked when the first outlet opens
    (:func:`labcrane.streams.outlets.check_clock`).

    Parameters
    ----------
    spin_s
        The last stretch before a time, in s, which is spun: sleep overshoots.
    """

    # Sleep overshoots by 30 to 70 us at the median.
    SPIN_S = 0.0005

    # A thread in real time wakes up sooner; one that never sleeps is stopped for 50 ms a second.
    REAL_TIME_SPIN_S = 0.0001

    def __init__(self, spin_s: float = SPIN_S) -> None:
        self._spin_s = spin_s

    def now(self) -> float:
        return time.perf_counter()

    def wait_until(self, due: float) -> None:
        if (remaining := due - self.now() - self._spin_s) > 0:
            time.sleep(remaining)
        while self.now() < due:
            pass


class ManualClock:
    """A clock that jumps: tests and offline simulation run as fast as they can."""

    def __init__(self, start: float = 0.0) -> None:
        self._now = start

    def now(self) -> float:
        return self._now

    def wait_until(self, due: float) -> None:
        self._now = max(self._now, due)


class Tick(NamedTuple):
    """One pass of the loop, counted from 0. Times are seconds on the run's clock."""

    number: int
    due: float
    woke: float

    @property
    def late_s(self) -> float:
        """Seconds from when the tick was due until the loop woke."""
        return self.woke - self.due


def ticks(clock: Clock, rate_hz: float) -> Iterator[Tick]:
    """Yield ticks at ``rate_hz`` for ever, the first one now."""
    start = clock.now()
    for number in itertools.count():
        yield tick_of(clock, start, number, rate_hz)


def tick_of(clock: Clock, start: float, number: int, rate_hz: float) -> Tick:
    """Wait for a tick of a run that began at ``start`` seconds, and return it."""
    due = start + number / rate_hz
    clock.wait_until(due)
    return Tick(number, due, clock.now())
