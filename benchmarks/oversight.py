"""What it costs to watch a component, as a share of a tick.

    python -m benchmarks.oversight

A bare crane and a watched one step in turn; the fastest of many rounds counts, because a busy
computer only ever makes a round slower.
"""

import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from benchmarks.table import Row, show
from labcrane import Dynamics
from labcrane.oversight import Oversight
from labcrane.registry import discover
from labcrane.testing import RATE_HZ, a_run, ch8
from labcrane.watched import watched

ROUNDS, CALLS, CALLS_PER_TICK = 200, 500, 6


def fastest(step: Callable[[], object]) -> float:
    """Return the time of a call in the fastest round, in seconds."""
    best = float("inf")
    for _ in range(ROUNDS):
        began = time.perf_counter()
        for _ in range(CALLS):
            step()
        best = min(best, (time.perf_counter() - began) / CALLS)
    return best


def rows() -> list[Row]:
    """Return what a watched step costs beside a bare one, and print its share of a tick."""
    machine, oversight = ch8(), Oversight()
    offer = discover().find(Dynamics, "kinematic_crane")
    bare = offer.build(offer.settings(), machine)
    kept = watched(offer.build(offer.settings(), machine), "kinematic_crane", "bullet", oversight)
    assert isinstance(kept, Dynamics)
    run, command = a_run(machine, state=bare.signals), np.full(4, 0.01)
    bare.open(run)
    kept.open(run)
    with (
        tempfile.TemporaryDirectory() as folder,
        oversight.published(Path(folder) / "bench.where"),
    ):
        alone = fastest(lambda: bare.step(command, 1 / RATE_HZ))
        seen = fastest(lambda: kept.step(command, 1 / RATE_HZ))
    share = 100 * CALLS_PER_TICK * (seen - alone) * RATE_HZ
    print(f"{CALLS_PER_TICK} watched calls are {share:.2f} % of a tick at {RATE_HZ:g} Hz")
    return [Row("oversight", "a watched step, us", 1e6 * seen, 1e6 * alone, "a bare step")]


if __name__ == "__main__":
    show(rows())
