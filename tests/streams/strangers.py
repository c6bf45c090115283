"""Unkind devices of a third kind: programs, counters and computers that went unthought of."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from streams.unkind import ROWS, Clock, received, regular
from streams.unkinder import MORE, a_little_off, announced

from labcrane.streams.sync.correction import Treatment
from labcrane.streams.sync.report.certificate import Fault

AGAIN = frozenset(
    {Fault.LATE_STAMPS, Fault.SHIFTED, Fault.DISORDERED, Fault.FROZEN}
    | {Fault.WRONG_RATE, Fault.CHANGED_RATE}
)
"""What samples that are sent again look like: nothing tells them from others of one stamp."""


def several_times(random):
    """Every sample is sent several times, by a program that asks faster than its device samples."""
    times = np.repeat(regular(random, 125.0), int(random.integers(2, 4)))
    return received(random, Clock(random), times, 125.0, clean=False, perhaps=AGAIN)


def resent(random):
    """Chunks that are sent again now and then, with the stamps that they had."""
    times = regular(random, 250.0)
    size = int(random.integers(5, 40))
    blocks = times[: len(times) // size * size].reshape(-1, size)
    often = np.ones(len(blocks), dtype=int)
    often[random.integers(10, len(blocks) - 10, int(random.integers(5, 40)))] = 2
    taken = np.repeat(blocks, often, axis=0)
    sent = np.repeat(np.maximum.accumulate(taken[:, -1]), size)
    return received(
        random, Clock(random), taken.ravel(), 250.0, sent=sent, clean=False, perhaps=AGAIN
    )


def sharing(random):
    """A device that gives several samples the stamp of the first, or of the last."""
    size, which = int(random.integers(2, 9)), int(random.choice([0, -1]))
    times = regular(random, 250.0)
    times = times[: len(times) // size * size]
    blocks = times.reshape(-1, size)
    stamped, sent = (np.repeat(blocks[:, k], size) for k in (which, -1))
    return received(
        random, Clock(random), times, 250.0, stamped=stamped, sent=sent,
        clean=False, chance=True, faults=frozenset({Fault.LATE_STAMPS}),
    )  # fmt: skip


def two_delays(random):
    """Even samples stamped on receipt, after one of two delays, as a bus of two speeds gives."""
    times = regular(random, 250.0)
    delay = random.uniform(5e-4, 2e-3) + random.exponential(5e-5, len(times))
    delay += random.choice([0.0, random.uniform(1e-3, 3e-3)], len(times))
    stamped = np.maximum.accumulate(times + delay)
    return received(
        random, Clock(random), times, 250.0, stamped=stamped, sent=stamped,
        treatment=Treatment(250.0, latency_s=float(delay.mean())),
        clean=False, chance=True, faults=frozenset({Fault.LATE_STAMPS}),
    )  # fmt: skip


def two_of_one_poll(random):
    """Even samples stamped when they are polled; now and then a poll gets two, with one stamp."""
    rate = float(random.choice([60.0, 90.0, 125.0, 200.0]))
    interval, times = random.uniform(1.003, 1.4) / rate, regular(random, rate)
    phase = random.uniform(0.0, interval)
    stamped = np.ceil((times - phase) / interval) * interval + phase
    return received(
        random, Clock(random), times, rate, stamped=stamped, sent=stamped,
        treatment=Treatment(rate, latency_s=float(np.mean(stamped - times))),
        clean=False, chance=True, faults=frozenset({Fault.LATE_STAMPS}),
    )  # fmt: skip


def alike_to_both_sides(random):
    """Even samples stamped on receipt, after delays that scatter by chance about their mean."""
    times = regular(random, 250.0)
    delay = 0.01 + random.normal(0.0, random.uniform(3e-4, 2e-3), len(times))
    stamped = np.maximum.accumulate(times + delay)
    return received(
        random, Clock(random), times, 250.0, stamped=stamped, sent=stamped,
        treatment=Treatment(250.0, latency_s=float(delay.mean())),
        clean=False, chance=True,
    )  # fmt: skip


def ticking(random):
    """Stamps of a timer that ticks in odd units, which its program may tell in whole ones."""
    told = float(random.choice([0.0, 0.0, 1e-3, 1e-6]))
    ticks = [1 / 64, 0.0156001, 1 / 60, 1 / 50, a_little_off(random, 5e-3, 0.03)]
    ticks += [] if told == 1e-3 else [1 / 1024, a_little_off(random, 3e-4, 3e-3)]
    tick, (times, rate) = float(random.choice(ticks)), announced(random)
    if abs(tick / 4e-3 - 1.0) < 0.3:  # what ticks nearly as it samples seems to lose samples
        tick *= 1.6
    clock = Clock(random)
    clock.ppm = random.choice([-1, 1]) * random.uniform(60.0, 200.0)
    drawn = received(random, clock, times, rate, clean=False)
    stamps = np.floor(drawn.raw.stamps / tick) * tick
    if told:
        stamps = np.floor(stamps / told + 1e-6) * told
    return replace(
        drawn, raw=replace(drawn.raw, stamps=stamps), grid_s=tick + told, chance=True,
        faults=frozenset({Fault.COARSE}),
        perhaps=frozenset({Fault.FROZEN, Fault.LATE_STAMPS, Fault.SLOW, Fault.NOISY}),
    )  # fmt: skip


def single_precision(random):
    """Stamps that went through a number of 32 bits."""
    times, rate = announced(random)
    drawn = received(random, Clock(random), times, rate, clean=False)
    stamps = np.float64(np.float32(drawn.raw.stamps))
    unit = float(np.spacing(np.float32(np.abs(stamps).max())))
    if unit < 1e-4 or 3e-3 < unit < 5e-3:  # as fine as others, or nearly what it samples in
        return single_precision(random)
    return replace(
        drawn, raw=replace(drawn.raw, stamps=stamps), grid_s=unit, chance=True,
        faults=frozenset({Fault.COARSE}),
        perhaps=frozenset({Fault.FROZEN, Fault.LATE_STAMPS, Fault.NOISY}),
    )  # fmt: skip


def guest(random):
    """A virtual machine whose clock stands still while its host is busy, and catches up."""
    clock, times = Clock(random), regular(random, 250.0)
    for begin in np.arange(times[0] + 15.0, times[-1] - 15.0, random.uniform(25.0, 100.0)):
        at, still, up = begin + random.uniform(0.0, 10.0), random.uniform(0.02, 0.2), 0.999
        length = random.uniform(0.2, 2.0)
        clock.slew(-up, at, at + still)
        clock.slew(up * still / length, at + still, at + still + length)
    shown = frozenset({Fault.STEPPED, Fault.SLEWED, Fault.CONGESTED, Fault.FROZEN, Fault.LOST})
    return received(
        random, clock, times, 250.0, clean=False, chance=True,
        perhaps=shown,
    )  # fmt: skip


def ramping(random):
    """A buffer that fills slowly: samples are stamped ever later, and then on time again."""
    times = regular(random, 250.0, 250.0, 500.0)
    every, most = random.uniform(60.0, 100.0), random.uniform(0.02, 0.04)
    late = ((times - times[0]) % every) / every * most
    stamped = times + late
    return received(
        random, Clock(random), times, 250.0, stamped=stamped, sent=np.maximum.accumulate(stamped),
        clean=False, chance=True, faults=frozenset({Fault.SHIFTED}),
    )  # fmt: skip


STRANGERS: dict[str, Callable] = {
    "every sample sent several times": several_times,
    "chunks sent again": resent,
    "several samples of one stamp": sharing,
    "ticks of an odd timer": ticking,
    "stamps in single precision": single_precision,
    "a guest whose clock stands still and catches up": guest,
    "even samples stamped after one of two delays": two_delays,
    "even samples, two of one poll now and then": two_of_one_poll,
}

ALL = {**ROWS, **STRANGERS, **MORE}
"""All kinds; in the order of the table in docs/reference/accuracy.md."""
