"""Calls that take longer than a tick: which computed, and which waited."""

import threading
import time

import numpy as np
import pytest
from rehearsal import ScriptedConsole

from labcrane import Frame, Tick
from labcrane.core import Event
from labcrane.registry import call_monitor as module
from labcrane.registry.call_monitor import CallMonitor, Overrun
from labcrane.session.overruns import OverrunReporter

PERIOD_S = 1 / 240


class Clocks:
    """The clock and the thread's own one, driven by hand."""

    def __init__(self) -> None:
        self.now = self.computed = 100.0

    def perf_counter(self) -> float:
        return self.now

    def thread_time(self) -> float:
        return self.computed


@pytest.mark.parametrize("seed", range(5))
def test_of_slow_calls_it_is_known_how_long_they_computed(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    random, clocks, monitor = np.random.default_rng(seed), Clocks(), CallMonitor()
    monkeypatch.setattr(module, "time", clocks)
    monitor.patience_s = PERIOD_S
    number = monitor.place("dynamics", "some", "step", len)
    took = random.uniform(0.0, 4 * PERIOD_S, 200)
    computed = took * random.choice([1.0, 0.01], 200)
    for tick, (wall, own) in enumerate(zip(took, computed, strict=True)):

        def step(wall: float = wall, own: float = own) -> None:
            clocks.now, clocks.computed = clocks.now + wall, clocks.computed + own

        monitor.begin_tick(tick)
        monitor.call(number, step)
    (overrun,) = monitor.overruns.values()
    slow = took > PERIOD_S
    assert overrun.calls == slow.sum()
    assert overrun.waited == (slow & (computed < PERIOD_S)).sum()
    assert overrun.worst_s == pytest.approx(took.max())
    assert overrun.computed_s == pytest.approx(computed[took.argmax()])


def test_a_call_that_waits_is_told_from_one_that_computes() -> None:
    found = {}
    for name in ("waits", "computes"):
        monitor = CallMonitor()
        monitor.patience_s = PERIOD_S
        number = monitor.place("dynamics", "some", name, len)
        monitor.begin_tick(0)
        until, at = time.thread_time() + 2 * PERIOD_S, time.perf_counter() + 2 * PERIOD_S

        def compute(until: float = until, at: float = at) -> None:
            while time.thread_time() < until or time.perf_counter() < at:  # Windows' goes in steps
                pass

        monitor.call(
            number,
            compute if name == "computes" else threading.Event().wait,
            *(() if name == "computes" else (10 * PERIOD_S,)),
        )
        (found[name],) = monitor.overruns.values()
    assert (found["waits"].calls, found["waits"].waited) == (1, 1)
    assert (found["computes"].calls, found["computes"].waited) == (1, 0)
    assert found["computes"].computed_s >= 2 * PERIOD_S


def test_outside_of_a_session_in_real_time_no_tick_asks_the_kernel(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(module, "time", None)  # nothing of it may be asked
    CallMonitor().begin_tick(1)


WAITED = "waited for a device, or for the processor that other programs had"


@pytest.mark.parametrize(
    ("waited", "said"),
    [
        (10, f"10 {WAITED}"),
        (1, f"9 computed for too long and 1 {WAITED}"),
        (0, "10 computed for too long"),
    ],
)
def test_the_record_says_how_many_slow_calls_computed_and_how_many_waited(
    waited: int, said: str
) -> None:
    class Log:
        def append(self, event: Event, tick: int) -> None:
            """Nothing to do."""

    monitor, console = CallMonitor(), ScriptedConsole()
    reporter = OverrunReporter(monitor, 240.0, Log(), console)
    monitor.overruns["scheme 'x'"] = Overrun()
    for number in range(10):
        took, computed = (0.02, 0.0004) if number < waited else (0.012, 0.0119)
        monitor.overruns["scheme 'x'"].add(took, computed, PERIOD_S)
    nothing = np.zeros(1)
    reporter(Frame(Tick(7, 1.0, 1.0), 0.0, nothing, nothing, nothing, nothing))
    (event,) = console.told
    worst_s, computed_s = (0.02, 0.0004) if waited else (0.012, 0.0119)
    assert event.data["why"] == (
        f"scheme 'x', took up to {1000 * worst_s:.0f} ms, and a tick has 4.2 ms; "
        f"of 10 such calls {said}"
    )
    assert (event.data["calls"], event.data["waited"]) == (10, waited)
    assert (event.data["worst_s"], event.data["computed_s"]) == (worst_s, computed_s)
