"""More unkind devices: what no report asked for, and faults that come together."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from streams.unkind import (
    ROWS,
    START,
    Clock,
    Drawn,
    in_chunks,
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
    raw = RawStream(drawn.raw.stamps, arrivals=drawn.raw.arrivals)
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
    raw = RawStream(drawn.raw.stamps, drawn.raw.probes[kept], drawn.raw.arrivals)
    gap = np.diff(raw.probes[:, 0]).max() / 2.0
    faults = frozenset({Fault.PROBES_MISSING} if gap > 30.0 else ())
    return replace(drawn, raw=raw, faults=faults)


def restarting_untold(random):
    """Another process takes its place, and liblsl does not say so."""
    drawn = ROWS["restarts with another clock"](random)
    raw = RawStream(drawn.raw.stamps, drawn.raw.probes, drawn.raw.arrivals)
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
        "own": {Fault.CONGESTED, Fault.LATE_STAMPS},
        "turned": {Fault.CONGESTED, Fault.SLEWED, Fault.CHANGED_RATE},
        "none": {Fault.CONGESTED, Fault.SLEWED, Fault.STEPPED},
    }[sampler]
    return received(
        random, clock, times, rate, way=random.uniform(1.5e-5, 1e-4), congestion=waits,
        clean=False, faults=faults, perhaps=frozenset(perhaps),
    )  # fmt: skip


def own_slewed(random):
    """NTP turns the recorder's own clock for a minute."""
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
    raw = RawStream(given.stamps, shown, came)
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
    return replace(drawn, raw=RawStream(times, drawn.raw.probes, drawn.raw.arrivals))


def paused(random):
    """A device that pauses, keeps its buffer and counts on: nothing is lost."""
    times = regular(random, 250.0)
    at = int(random.uniform(0.2, 0.8) * len(times))
    times[at:] += a_little_off(random, 1.5, 600.0)
    return received(
        random, Clock(random), times, 250.0, index=np.arange(float(len(times))),
        faults=frozenset({Fault.INTERRUPTED}),
    )  # fmt: skip


AHEAD_S = 0.055
"""What is stamped ahead by less may be markers of what is to come."""


def stamped_ahead(random, *, remote):
    """Markers stamped with the flip to come, as displays tell it before they are pushed."""
    clock = Clock(random)
    if not remote:
        clock.offset, clock.ppm, clock.changes = 0.0, 0.0, []
    times = START + np.sort(random.uniform(0.0, random.uniform(150, 400), 500))
    lead = random.uniform(0.005, 0.016)
    early = lead - random.uniform(0.0, 0.004) * random.random(len(times))
    return received(
        random, clock, times, 0.0, sent=np.maximum.accumulate(times - early),
        faults=frozenset({Fault.AHEAD}), clean=False,
    )  # fmt: skip


def foreign_nearby(random, *, side):
    """Stamps of a clock that is ahead of the probed one, or behind it as if samples were late."""
    times, rate = announced(random)
    off = a_little_off(random, 4e-3, 0.4)
    drawn = received(random, Clock(random), times, rate, clean=False)
    raw = RawStream(drawn.raw.stamps + side * off, drawn.raw.probes, drawn.raw.arrivals)
    if side > 0:
        # Markers that are stamped ahead of their push look alike, while it is by little.
        both = frozenset({Fault.FOREIGN, Fault.AHEAD} if not rate and off < AHEAD_S else ())
        fault = frozenset() if both else frozenset({Fault.FOREIGN})
        return replace(drawn, raw=raw, faults=fault, perhaps=both)
    slow = frozenset({Fault.SLOW})
    return replace(drawn, raw=raw, faults=slow if off > 0.05 else frozenset(), perhaps=frozenset())


def foreign_drifting(random):
    """Stamps of a clock that drifts away from the probed one.

    One that falls behind looks like a way that gets slower, one that runs ahead of markers like
    stamps of what is to come: probes that agree outweigh arrivals, and the uncertainty holds both.
    """
    times, rate = announced(random)
    ppm = random.choice([-1, 1]) * random.uniform(40.0, 200.0)
    drawn = received(random, Clock(random), times, rate, clean=False)
    stamps = drawn.raw.stamps + 1e-6 * ppm * (times - times[0])
    foreign = frozenset({Fault.FOREIGN})
    fault = foreign if rate and ppm > 0.0 else frozenset()
    either = frozenset() if rate or ppm < 0.0 else foreign | {Fault.AHEAD}
    raw = RawStream(stamps, drawn.raw.probes, drawn.raw.arrivals)
    return replace(drawn, raw=raw, faults=fault, perhaps=either)


def frozen(random):
    """Stamps that stand still at times, while samples go on."""
    drawn = received(random, Clock(random), regular(random, 250.0), 250.0)
    stamps = drawn.raw.stamps.copy()
    for at in random.integers(500, len(stamps) - 500, int(random.integers(3, 20))):
        stop = at + int(random.integers(5, 200))
        stamps[at:stop] = stamps[at]
    raw = RawStream(stamps, drawn.raw.probes, drawn.raw.arrivals)
    return replace(drawn, raw=raw, faults=frozenset({Fault.FROZEN}), clean=False)


def cut(random):
    """Stamps of a clock that counts coarse units, and tells the last that is full."""
    grid = float(random.choice([1 / 64, 0.01, 1e-3, 1e-4]))
    times, rate = announced(random)
    clock = Clock(random)
    clock.ppm = random.choice([-1, 1]) * random.uniform(60.0, 200.0)  # else none of 250 Hz is cut
    drawn = received(random, clock, times, rate, faults=frozenset({Fault.COARSE}), clean=False)
    since = random.choice([0.0, random.uniform(0.0, 1e4)])  # its program may count from its start
    stamps = np.floor((drawn.raw.stamps - since) / grid) * grid + since
    # Of some samples within one unit the stamps stand still.
    perhaps = frozenset({Fault.FROZEN, Fault.LATE_STAMPS, Fault.SLOW})
    raw = RawStream(stamps, drawn.raw.probes, drawn.raw.arrivals)
    return replace(drawn, raw=raw, grid_s=grid, perhaps=perhaps, chance=True)


def camera(random):
    """A camera that takes longer in the dark, at once or slowly; its stamps may be cut, too."""
    fast, slow = 1.0 / 30.0, random.uniform(1.2, 2.5) / 30.0
    steps = []
    turns = float(np.exp(random.uniform(np.log(1.0), np.log(60.0))))
    if random.random() < 0.3:
        phase = 2 * np.pi * np.arange(8000) * fast / turns
        steps = list(fast + (slow - fast) * (0.5 + 0.5 * np.sin(phase)))
    while len(steps) < 8000:
        for period in (fast, slow):
            steps += [period] * max(int(turns * random.uniform(0.5, 1.5) / period), 1)
    times = START + np.cumsum(steps[: int(random.uniform(4000, 8000))])
    either = frozenset({Fault.WRONG_RATE, Fault.CHANGED_RATE, Fault.LOST})
    drawn = received(random, Clock(random), times, 30.0, perhaps=either, uneven_s=np.inf)
    if random.random() < 0.5:
        return drawn
    stamps = np.floor(drawn.raw.stamps * 1e3) / 1e3
    raw = RawStream(stamps, drawn.raw.probes, drawn.raw.arrivals)
    coarse = frozenset({Fault.COARSE})
    return replace(drawn, raw=raw, faults=coarse, clean=False, grid_s=1e-3)


def just_behind(random):
    """Stamps of a clock that is behind the probed one by less than what most programs need."""
    times, rate = announced(random)
    drawn = received(random, Clock(random), times, rate, clean=False)
    off = random.uniform(5e-5, 1e-3)
    return replace(
        drawn, raw=RawStream(drawn.raw.stamps - off, drawn.raw.probes, drawn.raw.arrivals)
    )


def uneven(random, *, wrong):
    """Samples that come when they will, and the fault that an even stream would have, too."""
    times = START + np.sort(random.uniform(0.0, random.uniform(200, 500), 900))
    sent, end, index = times.copy(), float(times[-1]) + random.uniform(0.5, 3.0), None
    if wrong is Fault.LOST:
        kept = random.random(len(times)) > random.uniform(0.002, 0.05)
        kept[100] = False
        index, times, sent = np.arange(900.0)[kept], times[kept], sent[kept]
    elif wrong is Fault.DISORDERED:
        near = 10 + np.flatnonzero(np.diff(times[10:890]) < 0.3)
        for k in random.choice(near, int(random.integers(3, 40))):
            times[[k, k + 1]] = times[[k + 1, k]]
        sent = np.maximum.accumulate(times)
    elif wrong is Fault.STALLED:
        for _ in range(int(random.integers(5, 20))):
            at, length = random.uniform(times[0] + 5, times[-1] - 20), random.uniform(2.5, 6.0)
            held = (times >= at) & (times < at + length)
            sent[held] = np.maximum(sent[held], at + length)
    elif wrong is Fault.DIED:
        times = times[: int(900 * random.uniform(0.2, 0.8))]
        sent = times.copy()
    return received(
        random, Clock(random), times, 0.0, sent=sent, index=index, end=end,
        faults=frozenset({wrong}), lag_s=0.3 / len(times),  # the soonest of a few waits for a pull
    )  # fmt: skip


def quiet_at_last(random):
    """Markers that end, of a program that goes on: it answers probes, and did not die."""
    drawn = uneven(random, wrong=Fault.LOST)
    clock_end = drawn.raw.probes[-1, 3]
    many = drawn.raw.probes
    later = many + np.array([1.0, 0.0, 0.0, 1.0]) * (clock_end - many[0, 3] + 1.5)
    # Goes on as its clock usually does.
    slope = np.polyfit(many[:, 0] - many[0, 0], many[:, 1], 1)[0]
    later[:, 1] = many[:, 1] + slope * (later[:, 0] - many[:, 0])
    raw = replace(drawn.raw, probes=np.concatenate([many, later]))
    return replace(drawn, raw=raw, end=float(later[-1, 3] + 1.0))


def on_receipt(random, wait):
    """Even samples, each stamped when it is received; the mean of the delays is known.

    They wait as a ``wait`` lets them: for a program, for a poll of a bus, for a radio's turn.
    """
    rate = float(random.choice(wait.rates_hz))
    times = regular(random, rate, 150.0, 350.0)
    stamped = wait(times, random)
    mean = float(np.mean(stamped - times))
    counted = np.arange(float(len(times))) if random.random() < 0.3 else None
    return received(
        random, Clock(random), times, rate, stamped=stamped, sent=stamped, index=counted,
        treatment=Treatment(rate, latency_s=mean), faults=frozenset({Fault.LATE_STAMPS}),
        clean=False, chance=True,
    )  # fmt: skip


@dataclass(frozen=True)
class Wait:
    """How samples of a device wait: at which rates it may sample, and until when they wait."""

    rates_hz: tuple[float, ...]
    until: Callable

    def __call__(self, times, random):
        return self.until(times, random)


def serial(times, random):
    delay = 0.002 + random.exponential(random.uniform(5e-4, 3e-3), len(times))
    read = 3e-5 * np.arange(len(times))  # one after the other
    return np.maximum.accumulate(times + delay - read) + read


def polls(times, random, *, intervals, after):
    interval = random.choice(intervals)
    phase = random.uniform(0.0, interval)
    turn = np.ceil((times - phase) / interval) * interval + phase
    read = 1e-5 * (after > 0.0) * np.arange(len(times))  # one after the other
    return np.maximum.accumulate(turn + random.uniform(0.0, after, len(times)) - read) + read


SERIAL = Wait((125.0, 250.0, 500.0), serial)
USB = Wait((60.0, 90.0, 120.0), partial(polls, intervals=(0.004, 0.008, 0.016), after=1e-4))
RADIO = Wait(
    (50.0, 100.0, 128.0), partial(polls, intervals=(0.0075, 0.015, 0.03, 0.0486, 0.06), after=0.0)
)


def a_buffer_changes(random, *, counted, grows):
    """From some sample on all are stamped later by some time, or sooner; none is lost.

    A pause looks like a buffer that grows, a clock that is set back like one that shrinks, and
    stamps are not moved: whether a line through all of them comes nearer is chance.
    """
    times = regular(random, 250.0)
    most = 0.2 if grows else 0.045
    at, by = int(len(times) * random.uniform(0.2, 0.7)), random.uniform(0.02, most)
    delay = np.where((np.arange(len(times)) >= at) == grows, by, 0.0)
    sent = np.maximum.accumulate(times + delay)
    index = np.arange(float(len(times))) if counted else None
    if not counted and abs(250.0 * by - round(250.0 * by)) < 0.02:  # as if so many were lost
        return a_buffer_changes(random, counted=counted, grows=grows)
    return received(
        random, Clock(random), times, 250.0, stamped=times + delay, sent=sent, index=index,
        faults=frozenset({Fault.SHIFTED}), clean=False, chance=True,
    )  # fmt: skip


def by_a_wrong_rate(random):
    """Chunks of which the last sample is stamped right, the others by a rate that is not theirs."""
    told = 250.0
    off = float(np.exp(random.uniform(np.log(5e-4), np.log(1e-2))))
    size = int(random.integers(10, 250))
    times = regular(random, told * (1 + random.choice([-1, 1]) * off))
    times = times[: len(times) // size * size]
    last = times.reshape(-1, size)[:, -1]
    stamped = (last[:, None] + (np.arange(size) - (size - 1)) / told).ravel()
    # What is off by less is told as it is.
    return received(
        random, Clock(random), times, told, stamped=stamped, sent=np.repeat(last, size),
        clean=False, chance=True,
        perhaps=frozenset({Fault.WRONG_RATE, Fault.LATE_STAMPS, Fault.NOISY}),
    )  # fmt: skip


def last_of_a_chunk(random):
    """Chunks of the right rate whose last sample is stamped a little late."""
    size = int(random.integers(5, 60))
    times = regular(random, 250.0)
    usual = random.uniform(1e-4, 2e-3)
    times, stamped, sent = in_chunks(times, random, 250.0, size, 0.0, usual)
    return received(
        random, Clock(random), times, 250.0, stamped=stamped, sent=sent,
        clean=False, chance=True, faults=frozenset({Fault.LATE_STAMPS}),
    )  # fmt: skip


STEPPED = frozenset({Fault.STEPPED})
EITHER = frozenset({Fault.STEPPED, Fault.SLEWED})

MORE: dict[str, Callable] = {
    "samples of bursts stamped one by one": one_by_one,
    "chunks stamped when sent, under load": chunks_under_load,
    "the same, and samples lost": partial(chunks_under_load, drops=True),
    "two or three faults at once": together,
    "wireless that comes and goes": bad_wireless,
    "our own clock slewed": own_slewed,
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
    "a pause that the counter does not show": paused,
    "markers stamped with the flip to come": partial(stamped_ahead, remote=True),
    "the same, on our own computer": partial(stamped_ahead, remote=False),
    "a clock that drifts away": foreign_drifting,
    "stamps that stand still": frozen,
    "stamps cut to a coarse unit": cut,
    "a camera that takes longer in the dark": camera,
    "a clock behind by less than a millisecond": just_behind,
    "markers of which some are lost": partial(uneven, wrong=Fault.LOST),
    "markers out of order": partial(uneven, wrong=Fault.DISORDERED),
    "markers that stall and come in bursts": partial(uneven, wrong=Fault.STALLED),
    "markers whose program died": partial(uneven, wrong=Fault.DIED),
    "even samples stamped when a serial port is read": partial(on_receipt, wait=SERIAL),
    "even samples stamped by polls of a bus": partial(on_receipt, wait=USB),
    "even samples stamped when a radio has its turn": partial(on_receipt, wait=RADIO),
    "a buffer that grows": partial(a_buffer_changes, counted=False, grows=True),
    "a buffer that grows, a counter": partial(a_buffer_changes, counted=True, grows=True),
    "a buffer that shrinks": partial(a_buffer_changes, counted=False, grows=False),
    "a buffer that shrinks, a counter": partial(a_buffer_changes, counted=True, grows=False),
    "chunks stamped by a wrong rate": by_a_wrong_rate,
    "chunks whose last stamp is late": last_of_a_chunk,
    "seconds only": brief,
    "two hours, wandering": long,
    "steady, clean probes": clean_probes,
}
