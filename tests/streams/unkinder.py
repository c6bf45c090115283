"""More unkind devices: what no report asked for, and faults that come together."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from streams.unkind import (
    ROWS,
    START,
    Clock,
    Drawn,
    received,
    regular,
)

from labcrane.streams.sync.correction import Treatment
from labcrane.streams.sync.dejitter import Dejitter
from labcrane.streams.sync.raw import RawStream
from labcrane.streams.sync.report.certificate import Fault


def clean_probes(random):
    """Short ways of any asymmetry, as on one switch: little can hide."""
    clock = Clock(random)
    clock.ppm = random.uniform(-400, 400)
    way = random.uniform(1.2e-5, 4e-5)
    return received(random, clock, regular(random, 250.0), 250.0, way=way, limit_ms=0.02)


def one_by_one(random):
    """Samples that come in bursts, each stamped when its program gets it."""
    rate = float(random.choice([100.0, 250.0, 256.0]))
    times = regular(random, rate)
    size = int(random.integers(4, 40))
    times = times[: len(times) // size * size]
    last = times.reshape(-1, size)[:, -1]
    sent = last + 0.005 + random.exponential(random.uniform(1e-3, 5e-3), len(last))
    sent = np.maximum.accumulate(sent)
    each = random.uniform(0.0, 2e-4)  # none where a whole chunk has one stamp
    stamped = (sent[:, None] + each * np.arange(size)).ravel()
    mean = float(np.mean(stamped - times))
    return received(
        random, Clock(random), times, rate, stamped=stamped, sent=stamped,
        treatment=Treatment(rate, latency_s=mean),
        faults=frozenset({Fault.LATE_STAMPS}), clean=False,
    )  # fmt: skip


def chunks_under_load(random, *, drops=False):
    """Chunks stamped when sent, by a program that waits for its turn for seconds at a time.

    The waits pass and nothing is lost, or something is.
    """
    rate, size = 250.0, int(random.integers(10, 60))
    times = regular(random, rate, 50.0, 250.0)
    kept = np.ones(len(times), dtype=bool)
    if drops:
        for at in random.integers(size, len(times) - size, int(random.integers(5, 30))):
            kept[at : at + int(random.integers(1, 10))] = False
    times = times[kept][: int(kept.sum()) // size * size]
    last = times.reshape(-1, size)[:, -1]
    least, usual = random.uniform(0.004, 0.010), random.uniform(1e-3, 5e-3)
    delay = random.exponential(usual, len(last))
    for _ in range(int(random.integers(1, 5))):
        begin = random.uniform(last[0] - 5.0, last[-1])
        busy = (last > begin) & (last < begin + random.uniform(3.0, 20.0))
        delay[busy] += random.exponential(random.uniform(0.01, 0.08), int(busy.sum()))
    sent = np.maximum.accumulate(last + least + delay)
    stamped = (sent[:, None] + (np.arange(size) - (size - 1)) / rate).ravel()
    faults = {Fault.LATE_STAMPS, Fault.LOST} if drops else {Fault.LATE_STAMPS}
    return received(
        random, Clock(random), times, rate, stamped=stamped, sent=np.repeat(sent, size),
        treatment=Treatment(rate, dejitter=Dejitter.ENVELOPE, transport_s=least),
        faults=frozenset(faults), clean=False,
    )  # fmt: skip


def wrong_rate(random):
    told = float(random.choice([100.0, 250.0, 500.0]))
    real = told * (1 + random.choice([-1, 1]) * random.uniform(0.004, 0.08))
    return received(
        random, Clock(random), regular(random, real), told, faults=frozenset({Fault.WRONG_RATE})
    )


def slow_way(random):
    times = regular(random, 250.0)
    return received(
        random, Clock(random), times, 250.0, sent=times + random.uniform(0.08, 0.9),
        faults=frozenset({Fault.SLOW}), clean=False,
    )  # fmt: skip


def never_probed(random):
    drawn = received(random, Clock(random), regular(random, 250.0), 250.0)
    raw = RawStream.of(drawn.raw.stamps, None, drawn.raw.arrivals)
    return Drawn(raw, drawn.truth, drawn.treatment, frozenset({Fault.UNPROBED}), clean=False)


def stepping(random, low, high, most, **more):
    clock = Clock(random)
    times = regular(random, 250.0)
    for at in np.linspace(times[0] + 20.0, times[-1] - 20.0, int(random.integers(1, most + 1))):
        size = np.exp(random.uniform(np.log(low), np.log(high)))
        clock.step(random.choice([-1, 1]) * size, at + random.uniform(-8.0, 8.0))
    return received(random, clock, times, 250.0, **more)


def brief(random):
    return received(random, Clock(random), regular(random, 250.0, 6.0, 40.0), 250.0)


def long(random):
    clock = Clock(random)
    clock.wander(random.uniform(1e-3, 6e-3), random.uniform(500, 2000))
    return received(random, clock, regular(random, 50.0, 7000, 7400), 50.0)


def few_probes(random):
    drawn = received(random, Clock(random), regular(random, 250.0), 250.0)
    kept = random.random(len(drawn.raw.probes)) < random.uniform(0.2, 0.5)
    kept[[0, -1]] = True
    raw = RawStream.of(drawn.raw.stamps, drawn.raw.probes[kept], drawn.raw.arrivals)
    gap = np.diff(raw.probes[:, 0]).max() / 2.0
    faults = frozenset({Fault.PROBES_MISSING} if gap > 30.0 else ())
    return replace(drawn, raw=raw, faults=faults)


def restarting_untold(random):
    """Another process takes its place, and liblsl does not say so."""
    drawn = ROWS["restarts with another clock"](random)
    raw = RawStream.of(drawn.raw.stamps, drawn.raw.probes, drawn.raw.arrivals)
    return Drawn(raw, drawn.truth, drawn.treatment, frozenset({Fault.STEPPED, Fault.INTERRUPTED}))


def bad_wireless(random):
    """Delays on both ways that hold on for seconds and come back."""
    size, swing, phase = random.uniform(1e-3, 6e-3), random.uniform(3, 40), random.uniform(0, 6.3)
    lean = random.uniform(0.0, 1.0)

    def congestion(t, random):
        level = size * max(np.sin(2 * np.pi * t / swing + phase), 0.0) + random.exponential(1e-3)
        return level * lean, level * (1.0 - lean)

    return received(
        random, Clock(random), regular(random, 250.0), 250.0, way=random.uniform(3e-4, 1e-3),
        reply=random.uniform(1e-3, 8e-3), congestion=congestion, clean=False,
        perhaps=frozenset({Fault.CONGESTED}), chance=True,
    )  # fmt: skip


def busy_and_slewed(random, *, sampler="own"):
    """NTP turns the clock of a computer that is busy: most exchanges wait for one of two programs.

    How often, for how long and for which of them is drawn; at times all of them wait as long
    as the clock is turned. The sampler has a crystal of its "own", or is a program that goes by
    the "turned" clock and so changes its rate; or there is "none", and markers come when they will:
    where all probes were held up, a turn and a step are the same to them.
    """
    clock = Clock(random)
    begin, length = START + random.uniform(15, 60), random.uniform(5, 30)
    clock.slew(random.choice([-1, 1]) * random.uniform(500e-6, 5e-3), begin, begin + length)
    seldom, size = random.uniform(0.1, 0.8), np.exp(random.uniform(np.log(1e-3), np.log(0.03)))
    lean, all_along, busy = random.uniform(0.0, 1.0), random.random() < 0.3, False

    def waits(t, random):
        nonlocal busy
        busy = random.random() < (0.6 if busy else seldom)
        if not busy and not (all_along and begin - 5.0 < t < begin + length + 5.0):
            return tuple(random.exponential(1e-5, (2, 8)))
        return tuple(random.exponential(size, (2, 8)) * [[lean], [1.0 - lean]])

    rate, times = 250.0, regular(random, 250.0, 80, 200)
    if sampler == "turned":
        fine = np.arange(times[0], times[-1] + 0.1, 0.1)
        read = clock(fine)
        times = np.interp(np.linspace(read[0], read[-2], len(times)), read, fine)
    if sampler == "none":
        rate, times = 0.0, np.sort(random.uniform(times[0], times[-1], 600))
    faults = frozenset({Fault.SLEWED} if sampler == "own" else ())
    perhaps = {
        "own": {Fault.CONGESTED},
        "turned": {Fault.CONGESTED, Fault.SLEWED, Fault.CHANGED_RATE},
        "none": {Fault.CONGESTED, Fault.SLEWED, Fault.STEPPED},
    }[sampler]
    return received(
        random, clock, times, rate, way=random.uniform(1.5e-5, 1e-4), congestion=waits,
        clean=sampler == "own", faults=faults, perhaps=frozenset(perhaps),
    )  # fmt: skip


def own_slewed(random, *, logged):
    """NTP turns the recorder's own clock for a minute; on Linux its recorder logs that."""
    begin = START + random.uniform(50, 120)
    rate = random.choice([-1, 1]) * random.uniform(300e-6, 500e-6)
    end = begin + random.uniform(30, 90)

    def ours(t):
        return t + rate * (np.clip(t, begin, end) - begin)

    drawn = received(random, Clock(random), regular(random, 250.0), 250.0)
    given = drawn.raw
    middle, local = given.probes[:, 0] + given.probes[:, 1], given.probes[:, 3]
    trip = given.probes[:, 2]
    shown = np.column_stack(
        [
            given.probes[:, 0],
            (ours(middle - trip / 2) + ours(middle + trip / 2)) / 2 - given.probes[:, 0],
            ours(middle + trip / 2) - ours(middle - trip / 2),
            ours(local),
        ]
    )
    came = np.column_stack([given.arrivals[:, 0], ours(given.arrivals[:, 1])])
    read = np.sort(START + random.uniform(-1.0, drawn.truth[-1] - START + 1.0, 4 * len(local)))
    read = read[np.r_[True, np.diff(read) > 0.05]]
    crystal = random.uniform(-3e-5, 3e-5)
    seen = read + random.exponential(2e-7, len(read))
    log = np.column_stack([ours(read), 3e5 + seen * (1 + crystal)]) if logged else None
    raw = RawStream.of(given.stamps, shown, came, own=log)
    return replace(drawn, raw=raw, truth=ours(drawn.truth), faults=frozenset({Fault.SLEWED}))


def together(random):
    """A fault of the clock, one of the samples and one of the way, each there or not."""
    clock, faults = Clock(random), set()
    rate = float(random.choice([60.0, 100.0, 250.0, 500.0]))
    times = regular(random, rate)
    match random.integers(4):
        case 0:
            clock.step(
                random.choice([-1, 1]) * random.uniform(0.05, 10), START + random.uniform(50, 150)
            )
            faults.add(Fault.STEPPED)
        case 1:
            begin = START + random.uniform(50, 100)
            clock.slew(
                random.choice([-1, 1]) * random.uniform(300e-6, 700e-6),
                begin, begin + random.uniform(30, 60),
            )  # fmt: skip
            faults.add(Fault.SLEWED)
        case 2:
            clock.wander(random.uniform(1e-3, 3e-3), random.uniform(50, 80))
    match random.integers(4):
        case 0:
            kept = random.random(len(times)) > random.uniform(0.001, 0.003)
            kept[:50], kept[120] = True, False
            times = times[kept]
            faults.add(Fault.LOST)
        case 1:
            times = np.sort(times + random.normal(0.0, 0.2 / rate, len(times)))
        case 2:
            at = int(random.uniform(0.3, 0.7) * len(times))
            times[at:] = times[at] + (times[at:] - times[at]) / random.uniform(1.003, 1.01)
            faults.add(Fault.CHANGED_RATE)
    sent = times.copy()
    if random.integers(2):
        for _ in range(int(random.integers(2, 10))):
            begin, length = random.uniform(times[0] + 5, times[-1] - 20), random.uniform(1.5, 5.0)
            held = (times >= begin) & (times < begin + length)
            sent[held] = np.maximum(sent[held], begin + length)
        faults.add(Fault.STALLED)
    reply = random.uniform(1e-4, 2e-3) if random.integers(2) else 0.0
    perhaps = faults & {Fault.SLEWED} if reply else set()  # scattered probes show no knee
    return received(
        random, clock, times, rate, sent=sent, reply=reply,
        faults=frozenset(faults - perhaps), perhaps=frozenset(perhaps), clean=False,
    )  # fmt: skip


def announced(random):
    """Return times and nominal rate: of a regular device, one that says nothing, or markers."""
    times = regular(random, 250.0)
    match random.integers(3):
        case 0:
            return times, 250.0
        case 1:
            return times, 0.0
    span = times[-1] - times[0]
    return times[0] + np.sort(random.uniform(0.0, span, int(random.integers(200, 900)))), 0.0


def a_little_off(random, low, high):
    """Return a size between these, in seconds, any magnitude of them as likely."""
    return float(np.exp(random.uniform(np.log(low), np.log(high))))


def receivers_nearby(random):
    """Stamps of our clock already, and a source's clock that is not far from it."""
    times, rate = announced(random)
    clock = Clock(random)
    clock.ppm = random.uniform(-2.0, 2.0)
    clock.offset = random.choice([-1, 1]) * a_little_off(random, 4e-3, 0.4)
    clock.offset -= 1e-6 * clock.ppm * START
    drawn = received(random, clock, times, rate, faults=frozenset({Fault.RECEIVER}), clean=False)
    return replace(drawn, raw=RawStream.of(times, drawn.raw.probes, drawn.raw.arrivals))


def foreign_nearby(random, *, side):
    """Stamps of a clock that is ahead of the probed one, or behind it as if samples were late."""
    times, rate = announced(random)
    off = a_little_off(random, 4e-3, 0.4)
    drawn = received(random, Clock(random), times, rate, clean=False)
    raw = RawStream.of(drawn.raw.stamps + side * off, drawn.raw.probes, drawn.raw.arrivals)
    if side > 0:
        return replace(drawn, raw=raw, faults=frozenset({Fault.FOREIGN}))
    slow = frozenset({Fault.SLOW})
    return replace(drawn, raw=raw, faults=slow if off > 0.05 else frozenset(), perhaps=frozenset())


def foreign_drifting(random):
    """Stamps of a clock that drifts away from the probed one."""
    times, rate = announced(random)
    ppm = random.choice([-1, 1]) * random.uniform(40.0, 200.0)
    drawn = received(
        random, Clock(random), times, rate, faults=frozenset({Fault.FOREIGN}), clean=False
    )
    stamps = drawn.raw.stamps + 1e-6 * ppm * (times - times[0])
    return replace(drawn, raw=RawStream.of(stamps, drawn.raw.probes, drawn.raw.arrivals))


def frozen(random):
    """Stamps that stand still at times, while samples go on."""
    drawn = received(random, Clock(random), regular(random, 250.0), 250.0)
    stamps = drawn.raw.stamps.copy()
    for at in random.integers(500, len(stamps) - 500, int(random.integers(3, 20))):
        stop = at + int(random.integers(5, 200))
        stamps[at:stop] = stamps[at]
    raw = RawStream.of(stamps, drawn.raw.probes, drawn.raw.arrivals)
    return replace(drawn, raw=raw, faults=frozenset({Fault.FROZEN}), clean=False)


STEPPED = frozenset({Fault.STEPPED})
EITHER = frozenset({Fault.STEPPED, Fault.SLEWED})

MORE: dict[str, Callable] = {
    "samples of bursts stamped one by one": one_by_one,
    "chunks stamped when sent, under load": chunks_under_load,
    "the same, and samples lost": partial(chunks_under_load, drops=True),
    "two or three faults at once": together,
    "wireless that comes and goes": bad_wireless,
    "our own clock slewed, logged": lambda r: own_slewed(r, logged=True),
    "our own clock slewed, not logged": lambda r: own_slewed(r, logged=False),
    "slewed, and its computer busy": busy_and_slewed,
    "slewed with its sampler, and its computer busy": partial(busy_and_slewed, sampler="turned"),
    "markers, slewed, and their computer busy": partial(busy_and_slewed, sampler="none"),
    "small steps of its clock": lambda r: stepping(r, 5e-3, 5e-2, 1, faults=STEPPED),
    "steps too small to tell": lambda r: stepping(r, 5e-4, 5e-3, 3, clean=False, perhaps=EITHER),
    "steps again and again": lambda r: stepping(r, 0.05, 5.0, 8, faults=STEPPED),
    "another process, untold": restarting_untold,
    "never probed": never_probed,
    "most probes lost": few_probes,
    "wrong nominal rate": wrong_rate,
    "sent long after they were stamped": slow_way,
    "the receiver's clock, a little off": receivers_nearby,
    "a clock ahead of the probed one": partial(foreign_nearby, side=1.0),
    "a clock behind the probed one": partial(foreign_nearby, side=-1.0),
    "a clock that drifts away": foreign_drifting,
    "stamps that stand still": frozen,
    "seconds only": brief,
    "two hours, wandering": long,
    "steady, clean probes": clean_probes,
}

ALL = {**ROWS, **MORE}
