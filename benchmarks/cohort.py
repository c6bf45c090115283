"""Simulated cohort compared with bare PyBullet ticks: one core, two cores, memory, and power.

    python -m benchmarks.cohort [--participants 36]

Participants of the aiming study are simulated and consolidated. After each, the engine alone
makes a fifth of its ticks: four motors set, one step, four joints read. It runs with the
settings that a crane needs by itself (200 solver passes, no residual threshold, limits of
1e7 N m), and with the 400 passes of labcrane's crane. Times of one core are the process's own.

Two processes at once slow each other down: they share caches and, on many computers, cores. Two
workers of one command are therefore compared with two commands at once, which share the
participants, and those of the crane study with two bare engines at once. For power, cohorts of two
sizes are sampled from a pool; the time of one more gives that of a thousand.
"""

import argparse
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from pathlib import Path

from benchmarks.bare_engine import BareEngine
from benchmarks.own_process import Use, spent_s, used
from benchmarks.table import Row, show
from labcrane.core.records import Frame
from labcrane.protocol.study import Study, load
from labcrane.registry.registry import discover
from labcrane.simulation.fast_forward import FastForward
from labcrane.simulation.simulation import SimulationJob, simulate

AIMING = Path(__file__).parents[1] / "protocols" / "aiming" / "protocol.yaml"
CRANE_PILOT = AIMING.parents[1] / "crane_pilot" / "protocol.yaml"
PASSES = (200, 400)
PART = 5
"""One bare tick is made for so many of a participant's."""

SAMPLE = 100_000
"""Number of bare ticks from which the time of a cohort's ticks is extrapolated."""

PILOT_TIMES = 0.5
"""What the crane study's 36 may take beside bare ticks."""

TWO_TIMES = 1.25
"""What two workers may take beside two commands at once, with half of the participants each."""

COHORTS, FEW, MORE = 1000, 20, 120
POWER_S = 600.0
"""What so many cohorts of 36 may take, with their pool, in seconds of the processor."""


PARTICIPANTS = 36


def rows(*, brief: bool = False) -> list[Row]:
    """Return all figures."""
    return rows_of(4, FEW + 4) if brief else rows_of(PARTICIPANTS)


def rows_of(participants: int, more: int = MORE) -> list[Row]:
    """Return all figures of so many; of power, from cohorts of two numbers, ``FEW`` and more.

    A third of the participants are compared tick by tick, and half with all of them.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        found = one_core(folder, participants // 3)
        found += two_cores_and_memory(folder, participants // 2, participants)
        found.append(pilot(folder, participants))
        found += power(folder, participants, more)
    return found


def one_core(folder: Path, participants: int) -> list[Row]:
    """Simulate all participants in this process, with bare ticks in between."""
    study = load(AIMING, discover())
    simulate(SimulationJob(AIMING, None, folder / "first", "P001"))  # loads, and compiles once
    ours, ticks, stepping = 0.0, 0, Stepping()
    bare = dict.fromkeys(PASSES, 0.0)
    for number in range(1, participants + 1):
        order = SimulationJob(AIMING, None, folder / "one", f"P{number:03}")
        began = time.process_time()
        with stepping.timed():
            simulate(order)
        ours += time.process_time() - began
        count = recorded(order.folder.participant_file)
        ticks += count
        for passes in PASSES:
            bare[passes] += bare_s(study, passes, count // PART) * count / (count // PART)
    whole = {200: 0.52, 400: 0.31}
    made = f"{participants} participants, {stepping.ticks} ticks by kernels, us per tick"
    return [
        *(
            Row(
                "cohort",
                f"{participants} participants, {ticks} ticks with their files, us per tick",
                1e6 * ours / ticks,
                1e6 * bare[passes] / ticks,
                f"bare PyBullet, {passes} passes",
                whole[passes],
            )
            for passes in PASSES
        ),
        Row(
            "cohort",
            made,
            1e6 * stepping.seconds / stepping.ticks,
            1e6 * bare[200] / ticks,
            "bare PyBullet, 200 passes",
            0.09,
        ),
    ]


class Stepping:
    """What kernels take for their ticks, with everything that is handed over."""

    def __init__(self) -> None:
        self.seconds, self.ticks = 0.0, 0

    @contextmanager
    def timed(self) -> Iterator[None]:
        """Time every run of ticks meanwhile."""
        plain = FastForward.__call__

        def call(forward: FastForward, frame: Frame, start: float) -> Frame:
            began = time.process_time()
            last = plain(forward, frame, start)
            self.seconds += time.process_time() - began
            self.ticks += last.tick.number - frame.tick.number
            return last

        FastForward.__call__ = call
        try:
            yield
        finally:
            FastForward.__call__ = plain


def recorded(path: Path) -> int:
    """Return the ticks in a participant file."""
    import h5py  # noqa: PLC0415 - loads for a second

    with h5py.File(path) as file:
        return len(file["ses-01/time"])


def bare_s(study: Study, passes: int, count: int) -> float:
    """Return the processor's seconds for so many ticks of the engine alone."""
    with BareEngine(study.machine, study.protocol.rate_hz, passes) as engine:
        began = time.process_time()
        for _ in range(count):
            engine.tick()
        return time.process_time() - began


def command(folder: Path, participants: int, workers: int) -> Use:
    """Run ``labcrane simulate`` in a process of its own; return what it used."""
    words = ["simulate", str(AIMING), "--out", str(folder)]
    return used(*words, "--participants", str(participants), "--workers", str(workers))


def two_cores_and_memory(folder: Path, few: int, many: int) -> Iterator[Row]:
    """Compare two workers with two commands, and the memory for few participants and for many."""
    two = command(folder / "two", many, 2).seconds
    with ThreadPoolExecutor(2) as pool:
        halves = list(pool.map(lambda name: command(folder / name, few, 1), ("one", "other")))
    large = command(folder / "whole", many, 1).megabytes
    what = f"{many} participants with two workers, s"
    apart = max(each.seconds for each in halves)
    yield Row("cohort", what, two, apart, f"two commands at once, {few} each", TWO_TIMES)
    small = halves[0].megabytes
    yield Row("cohort", f"{many} participants, MB at most", large, small, f"{few} of them", 1.15)


def pilot(folder: Path, participants: int) -> Row:
    """Simulate the crane study as people do, with two workers."""
    data = folder / "pilot"
    words = ("--participants", str(participants), "--workers", "2")
    ours = spent_s("simulate", str(CRANE_PILOT), "--out", str(data), *words)
    ticks = sum(map(recorded, data.glob("*/*.h5")))
    with ProcessPoolExecutor(2, get_context("spawn")) as pool:
        bare = sum(pool.map(bare_sample_s, (CRANE_PILOT,) * 2)) / 2.0 * ticks / SAMPLE
    what = f"crane_pilot, {participants} participants, two workers, processor's s with start-up"
    return Row(
        "cohort", what, ours, bare, f"bare PyBullet, {ticks} ticks, two at once", PILOT_TIMES
    )


def bare_sample_s(protocol: Path) -> float:
    """Return the processor's seconds for ``SAMPLE`` ticks of the engine of a study alone."""
    return bare_s(load(protocol, discover()), PASSES[0], SAMPLE)


def power(folder: Path, size: int, more: int) -> Iterator[Row]:
    """Plan the crane study by two of the report's tests: few cohorts, then some more.

    Both draw from one pool, whose making counts for each of them.
    """
    words = ["power", str(CRANE_PILOT), "--out", str(folder / "power")]
    words += ["--participants", str(size), "--effect", "movement_time~sequence"]

    def took(test: str, cohorts: int) -> float:
        return spent_s(*words, "--test", test, "--cohorts", str(cohorts))

    pool_s = took("trend", FEW) - took("trend", FEW)  # the second finds the pool
    for test in ("trend", "anova"):
        few_s, more_s = (took(test, count) for count in (FEW, more))
        whole = pool_s + few_s + (COHORTS - FEW) * (more_s - few_s) / (more - FEW)
        what = f"power, {test}, {COHORTS} cohorts of {size}, processor's s"
        yield Row("cohort", what, whole, POWER_S, "promised", 1.0)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--participants", type=int, default=PARTICIPANTS)
    show(rows_of(parser.parse_args().participants))
