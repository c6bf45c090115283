"""Programs that keep every core busy, and one per core that sees whether it stood still.

On a computer that is shared with others, all its cores, or one, may stand still for a while. What
is due then is late, whatever its priority. Run with a core's number, this tells for how long its
core did nothing though a program with a higher real-time priority than any sound wanted to run.
"""

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

PRIORITY = 90
STEP_S = 0.001


@dataclass
class Standstill:
    """For how long a core stood still at most, and in all, in s; known when all is over."""

    most_s: float = 0.0
    total_s: float = 0.0


@contextmanager
def crowded_computer() -> Iterator[Standstill]:
    """Keep every core busy with ordinary programs, and watch whether it stands still."""
    found, cores = Standstill(), os.sched_getaffinity(0)
    idle = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in cores]
    watching = [subprocess.Popen([sys.executable, __file__, str(core)], **idle) for core in cores]
    try:
        yield found
        said = [[float(word) for word in each.communicate("")[0].split()] for each in watching]
        found.most_s = max(most for most, _ in said)
        found.total_s = max(total for _, total in said)
    finally:
        for each in busy + watching:
            each.kill()
            each.communicate()


def watch(core: int) -> tuple[float, float]:
    """Return how long ``core`` stood still at most, and in all, until the input is closed."""
    os.sched_setaffinity(0, {core})
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    os.set_blocking(0, False)
    most, total, before = 0.0, 0.0, time.perf_counter()
    while sys.stdin.buffer.read() is None:
        time.sleep(STEP_S)
        now = time.perf_counter()
        still, before = now - before - STEP_S, now
        most, total = max(most, still), total + (still if still > STEP_S else 0.0)
    return most, total


if __name__ == "__main__":
    sys.stdout.write("{} {}\n".format(*watch(int(sys.argv[1]))))
