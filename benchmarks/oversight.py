"""Monitoring of a component, as a share of a tick.

    python -m benchmarks.oversight

A bare crane and a watched one step in turn; the fastest of many rounds counts, because a busy
computer only ever makes a round slower.
"""

import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from benchmarks.table import Row
from labcrane import Dynamics
from labcrane.registry.call_monitor import CallMonitor
from labcrane.registry.proxies import watched
from labcrane.registry.registry import discover
from labcrane.testing import RATE_HZ, ch8, make_run

ROUNDS, CALLS, CALLS_PER_TICK = 200, 500, 6


def fastest(step: Callable[[], object], rounds: int) -> float:
    """Return the time of a call in the fastest round, in seconds."""
    best = float("inf")
    for _ in range(rounds):
        began = time.perf_counter()
        for _ in range(CALLS):
            step()
        best = min(best, (time.perf_counter() - began) / CALLS)
    return best


def steps(rounds: int = ROUNDS) -> tuple[float, float]:
    """Return how long a step of a crane takes, bare and watched, in seconds."""
    machine, oversight = ch8(), CallMonitor()
    offer = discover().find(Dynamics, "kinematic_crane")
    bare = offer.build(offer.settings(), machine)
    kept = watched(offer.build(offer.settings(), machine), "kinematic_crane", "bullet", oversight)
    assert isinstance(kept, Dynamics)
    run, command = make_run(machine, state=bare.signals), np.full(4, 0.01)
    bare.open(run)
    kept.open(run)
    with (
        tempfile.TemporaryDirectory() as folder,
        oversight.published(Path(folder) / "bench.where"),
    ):
        alone = fastest(lambda: bare.step(command, 1 / RATE_HZ), rounds)
        seen = fastest(lambda: kept.step(command, 1 / RATE_HZ), rounds)
    return alone, seen


def rows(*, brief: bool = False) -> list[Row]:
    """Return what a watched step costs beside a bare one."""
    alone, seen = steps(1 if brief else ROUNDS)
    return [
        Row("oversight", "a watched step of a crane, us", 1e6 * seen, 1e6 * alone, "unwatched", 2.5)
    ]


def main() -> None:
    """Print the cost of a call, bare and watched, and of all calls of a tick."""
    alone, seen = steps()
    cost = seen - alone
    print(f"a step {1e6 * alone:.2f} us, watched {1e6 * seen:.2f} us: {1e6 * cost:.2f} us more")
    share = 100 * CALLS_PER_TICK * cost * RATE_HZ
    print(f"{CALLS_PER_TICK} calls are {share:.2f} % of a tick at {RATE_HZ:g} Hz")


if __name__ == "__main__":
    main()
