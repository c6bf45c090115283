"""The clock: a grid that lateness does not move, on the time that liblsl tells."""

import time

import pytest

from labcrane.core.clock import ManualClock, SystemClock, ticks


def test_ticks_are_due_on_a_grid_that_lateness_does_not_move() -> None:
    clock = ManualClock(start=100.0)
    due: list[float] = []
    woke: list[float] = []
    for tick in ticks(clock, rate_hz=10.0):
        due.append(tick.due)
        woke.append(tick.woke)
        if tick.number == 1:
            clock.wait_until(100.25)  # one slow tick
        if tick.number == 4:
            break
    assert due == pytest.approx([100.0, 100.1, 100.2, 100.3, 100.4])
    assert woke == pytest.approx([100.0, 100.1, 100.25, 100.3, 100.4])


def test_the_system_clock_never_wakes_early() -> None:
    clock = SystemClock()
    for wait in (-1.0, 0.0, 0.0002, 0.003):
        due = clock.now() + wait
        clock.wait_until(due)
        assert clock.now() >= due


def test_the_system_clock_is_the_one_that_liblsl_reads() -> None:
    import pylsl

    for _ in range(20):
        before = time.perf_counter()
        theirs = pylsl.local_clock()
        after = time.perf_counter()
        assert before <= theirs <= after
