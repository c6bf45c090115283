"""Devices and clocks that are unkind, drawn at random, with known truth."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from labcrane.streams.sync.correction import Treatment
from labcrane.streams.sync.raw import RawStream
from labcrane.streams.sync.report.certificate import Fault


@dataclass(frozen=True)
class Drawn:
    """A stream as received, when its samples were really taken, and what is wrong with it.

    ``hidden_s`` is by how much the two ways of all probes differ for good, halved: with the same
    probes nobody can know it. ``apart_ms`` limits the error beside it. ``chance`` is whether what
    holds up either way differs all along: then any correction is off by chance, and which of two is
    better can be told of many draws, not of one. So it is where stamps are half a unit early.
    ``lag_s`` is how long its samples are under way: arrivals cannot tell that from a clock that is
    behind, and the uncertainty must say so.
    ``grid_s`` is what its stamps are cut to: whether they are half of it early, nothing tells.
    ``uneven_s`` is by how much its samples may lie beside an even count: whether its stamps do, and
    not its samples, nothing tells either.
    ``perhaps`` is what may be named or not: a step of a millisecond, say, is a slew as well.
    """

    raw: RawStream
    truth: np.ndarray
    treatment: Treatment
    faults: frozenset[Fault] = frozenset()
    end: float | None = None
    clean: bool = True
    limit_ms: float = 0.1
    perhaps: frozenset[Fault] = frozenset()
    hidden_s: float = 0.0
    apart_ms: float = np.inf
    chance: bool = False
    lag_s: float = 0.0
    grid_s: float = 0.0
    uneven_s: float = 0.0


@dataclass
class Clock:
    """A remote clock as a function of ours: offset, skew, wander, and changes of both."""

    random: np.random.Generator
    offset: float = 0.0
    ppm: float = 0.0
    changes: list[Callable] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.offset = self.random.uniform(-5e4, 5e4)
        self.ppm = self.random.uniform(-60.0, 60.0)
        phase, period = self.random.uniform(0, 6.3), self.random.uniform(600, 3000)
        size = self.random.uniform(0, 2e-6) * period / 6.3
        self.changes = [lambda t: size * np.sin(2 * np.pi * t / period + phase)]

    def __call__(self, t):
        t = np.asarray(t, dtype=np.float64)
        return t + self.offset + 1e-6 * self.ppm * t + sum(change(t) for change in self.changes)

    def slew(self, rate, start, stop):
        self.changes.append(lambda t: rate * (np.clip(t, start, stop) - start))

    def step(self, size, at):
        self.changes.append(lambda t: np.where(t >= at, size, 0.0))

    def wander(self, size, period):
        phase = self.random.uniform(0, 6.3)
        self.changes.append(lambda t: size * np.sin(2 * np.pi * t / period + phase))


WAY, SHARE = (3e-5, 1.5e-4), (0.3, 0.7)


def probes(clock, start, stop, random, *, way=None, share=None, congestion=None, reply=0.0):
    """Probe as liblsl does: of eight exchanges, the one with the shortest round trip.

    ``share`` of the shortest round trip lies on the way there; ``congestion`` gives the delays
    there and back that are added at times.
    """
    every = random.uniform(1.0, 2.0)
    way = random.uniform(*WAY) if way is None else way
    share = random.uniform(*SHARE) if share is None else share
    rows = []
    for begin in np.arange(start, stop, every):
        sent = begin + 0.064 * np.arange(8)
        extra = congestion(begin, random) if congestion else (0.0, 0.0)
        there = sent + 2 * way * share * (1 + random.exponential(0.15, 8)) + extra[0]
        back = there + 2 * way * (1 - share) * (1 + random.exponential(0.15, 8)) + extra[1]
        back = back + random.exponential(reply, 8) if reply else back
        k = int(np.argmin(back - sent))
        remote = float(clock(there[k]))
        middle = (sent[k] + back[k]) / 2
        rows.append((remote, middle - remote, back[k] - sent[k], begin + 0.6))
    return np.array(rows)


def arrivals(sent, *, pull=0.03):
    """Return what a recorder notes of samples sent at these times, in the order of sending."""
    pulled = np.ceil((np.maximum.accumulate(sent) + 2e-4) / pull) * pull
    last = np.flatnonzero(np.r_[np.diff(pulled) > 0, True])
    return np.column_stack([last + 1.0, pulled[last]])


START = 1000.0


def regular(random, rate, low=200.0, high=500.0):
    duration = random.uniform(low, high)
    own = rate * (1 + random.uniform(-40e-6, 40e-6))  # the sampler's own crystal
    return START + np.arange(int(duration * own)) / own


def received(random, clock, times, rate, *, stamped=None, sent=None, index=None, **more):
    stamped = times if stamped is None else stamped
    sent = np.maximum(stamped, times) if sent is None else sent
    keys = ("way", "share", "congestion", "reply")
    how = {key: more.pop(key) for key in keys if key in more}
    way = how.setdefault("way", random.uniform(*WAY))
    share = how.setdefault("share", random.uniform(*SHARE))
    shown = probes(clock, sent[0] + 0.4, sent[-1] + 0.5, random, **how)
    treatment = more.pop("treatment", Treatment(rate_hz=rate))
    raw = RawStream(clock(stamped), shown, arrivals(sent), index=index)
    return Drawn(raw, times, treatment, hidden_s=way * (1.0 - 2.0 * share), **more)


def steady(random):
    clock = Clock(random, 0.0)
    clock.ppm = random.uniform(-400, 400)
    return received(random, clock, regular(random, 250.0), 250.0, apart_ms=0.02)


def lost(random, rate, share, most):
    times = regular(random, rate)
    kept = random.random(len(times)) > share * random.uniform(0.5, 2.0)
    kept[:50] = True
    kept[100 + int(random.integers(50))] = False
    return received(
        random, Clock(random), times[kept], rate, faults=frozenset({Fault.LOST}), limit_ms=most
    )


def eye_tracker(random):
    rate = float(random.choice([60.0, 120.0]))
    times = np.sort(regular(random, rate))
    scatter = random.uniform(0.5e-3, 3e-3)
    times = times + random.normal(0.0, scatter, len(times))
    return received(random, Clock(random), np.sort(times), rate, uneven_s=3.0 * scatter)


def changed_rate(random):
    rate = 100.0
    first, second = regular(random, rate, 120, 250), regular(random, rate, 120, 250)
    second = (second - START) / random.uniform(1.003, 1.01) + first[-1] + 1 / rate
    times = np.r_[first, second]
    return received(random, Clock(random), times, rate, faults=frozenset({Fault.CHANGED_RATE}))


def warming(random):
    rate = 100.0
    n = int(rate * random.uniform(250, 500))
    rates = rate * (1 + random.uniform(0.005, 0.015) * np.exp(-np.arange(n) / rate / 90.0))
    times = START + np.cumsum(1 / rates)
    return received(
        random, Clock(random), times, rate, faults=frozenset({Fault.CHANGED_RATE}), uneven_s=3e-4
    )


def receivers_clock(random):
    times = regular(random, 250.0)
    clock = Clock(random)
    clock.offset = random.choice([-1, 1]) * random.uniform(0.06, 0.5) - 1e-6 * clock.ppm * START
    drawn = received(random, clock, times, 250.0, faults=frozenset({Fault.RECEIVER}), clean=False)
    return Drawn(
        RawStream(times, drawn.raw.probes, drawn.raw.arrivals),
        times, drawn.treatment, drawn.faults, clean=False,
    )  # fmt: skip


def foreign_clock(random):
    times = regular(random, 250.0)
    clock, other = Clock(random), Clock(random)
    drawn = received(random, clock, times, 250.0, faults=frozenset({Fault.FOREIGN}), clean=False)
    return Drawn(
        RawStream(other(times), drawn.raw.probes, drawn.raw.arrivals),
        times, drawn.treatment, drawn.faults, clean=False,
    )  # fmt: skip


def in_chunks(times, random, rate, size, least, mean):
    """Return the stamps and the sending of chunks stamped by when they are sent."""
    whole = len(times) // size * size
    times = times[:whole]
    last = times.reshape(-1, size)[:, -1]
    sent = last + least + random.exponential(mean - least, len(last))
    stamped = (sent[:, None] + (np.arange(size) - (size - 1)) / rate).ravel()
    return times, stamped, np.repeat(sent, size)


def chunks(random):
    size = int(random.integers(100, 400))
    least = random.uniform(0.004, 0.010)
    mean = least + random.uniform(0.001, 0.005)
    times, stamped, sent = in_chunks(
        regular(random, 1000.0, 300, 600), random, 1000.0, size, least, mean
    )
    return received(
        random, Clock(random), times, 1000.0, stamped=stamped, sent=sent,
        treatment=Treatment(1000.0, latency_s=mean),
        faults=frozenset({Fault.LATE_STAMPS}), clean=False,
    )  # fmt: skip


def bluetooth(random, *, counted):
    times = regular(random, 250.0, 300, 600)
    kept = np.ones(len(times), dtype=bool)
    for at in random.integers(500, len(times) - 20, int(random.integers(10, 60))):
        kept[at : at + int(random.integers(1, 10))] = False
    index = np.arange(len(times), dtype=np.float64)[kept]
    size = int(random.integers(25, 75))  # bursts of 100 to 300 ms
    truth, stamped, sent = in_chunks(
        times[kept], random, 250.0, size, 0.005, random.uniform(0.02, 0.05)
    )
    mean = float(np.mean(sent.reshape(-1, size)[:, -1] - truth.reshape(-1, size)[:, -1]))
    return received(
        random, Clock(random), truth, 250.0, stamped=stamped, sent=sent,
        index=index[: len(truth)] if counted else None,
        treatment=Treatment(250.0, latency_s=mean),
        faults=frozenset({Fault.LOST, Fault.LATE_STAMPS}), clean=False,
    )  # fmt: skip


def shuffled(random):
    times = regular(random, 500.0)
    size = int(random.integers(10, 40))
    blocks = times[: len(times) // size * size].reshape(-1, size)
    order = np.arange(len(blocks))
    for k in random.integers(10, len(blocks) - 1, int(random.integers(5, 60))):
        order[[k, k + 1]] = order[[k + 1, k]]
    taken = blocks[order].ravel()
    sent = np.repeat(np.maximum.accumulate(taken.reshape(-1, size)[:, -1]), size)
    return received(
        random, Clock(random), taken, 500.0, sent=sent, faults=frozenset({Fault.DISORDERED})
    )


def wandering_markers(random):
    clock = Clock(random)
    clock.wander(random.uniform(1e-3, 3e-3), random.uniform(50, 80))
    clock.wander(random.uniform(2e-4, 8e-4), random.uniform(15, 25))
    times = START + np.sort(random.uniform(0, random.uniform(200, 500), 600))
    at = START + random.uniform(60, 150)
    clock.step(random.choice([-1, 1]) * random.uniform(0.2, 10.0), at)
    return received(random, clock, times, 0.0, faults=frozenset({Fault.STEPPED}))


def slewed(random, low, high, seconds):
    clock = Clock(random)
    start = START + random.uniform(50, 120)
    rate = random.choice([-1, 1]) * random.uniform(low, high)
    clock.slew(rate, start, start + random.uniform(*seconds))
    return received(random, clock, regular(random, 250.0), 250.0, faults=frozenset({Fault.SLEWED}))


def congested(random):
    start, delay = START + random.uniform(100, 400), random.uniform(4e-3, 1e-2)
    stop, way = start + random.uniform(100, 180), int(random.integers(2))

    def congestion(t, random):
        extra = delay * random.uniform(0.7, 1.0) if start < t < stop else 0.0
        return (extra, 0.0) if way == 0 else (0.0, extra)

    return received(
        random, Clock(random), regular(random, 100.0, 900, 1500), 100.0, congestion=congestion,
        faults=frozenset({Fault.CONGESTED}), limit_ms=0.3,
    )  # fmt: skip


def died(random):
    whole = regular(random, 250.0)
    times = whole[: int(len(whole) * random.uniform(0.2, 0.6))]
    return received(
        random, Clock(random), times, 250.0, end=float(whole[-1]),
        faults=frozenset({Fault.DIED}),
    )  # fmt: skip


def stalling(random):
    times = regular(random, 250.0)
    sent = times.copy()
    for _ in range(int(random.integers(5, 30))):
        at, length = random.uniform(times[0] + 5, times[-1] - 20), random.uniform(1.5, 5.0)
        held = (times >= at) & (times < at + length)
        sent[held] = np.maximum(sent[held], at + length)
    return received(
        random, Clock(random), times, 250.0, sent=sent, faults=frozenset({Fault.STALLED})
    )


def sleeping(random):
    """The remote computer sleeps: its clock stands still, nothing is sampled."""
    times = regular(random, 250.0)
    at, length = START + random.uniform(50, 120), random.uniform(5, 120)
    clock = Clock(random)
    clock.changes.append(lambda t: -np.clip(t - at, 0.0, length))
    times = np.r_[times[times < at], times[times >= at] + length]
    drawn = received(
        random, clock, times, 250.0, faults=frozenset({Fault.SLEPT, Fault.INTERRUPTED})
    )
    local = drawn.raw.probes[:, 3]
    awake = (local < at) | (local > at + length + 1.5)
    raw = RawStream(drawn.raw.stamps, drawn.raw.probes[awake], drawn.raw.arrivals)
    return replace(drawn, raw=raw)


def jumping(random):
    clock = Clock(random)
    clock.step(random.choice([-1, 1]) * random.uniform(0.05, 10), START + random.uniform(50, 150))
    return received(random, clock, regular(random, 250.0), 250.0, faults=frozenset({Fault.STEPPED}))


def restarting(random):
    parts = [
        received(random, Clock(random), regular(random, 250.0, 80, 200), 250.0) for _ in range(2)
    ]
    first, second = parts
    gap = first.truth[-1] - START + random.uniform(2.0, 20.0)
    later = second.truth + gap
    n = len(first.truth)
    moved = second.raw.probes + np.array([0.0, gap, 0.0, gap])
    raw = RawStream(
        np.r_[first.raw.stamps, second.raw.stamps],
        np.concatenate([first.raw.probes, moved]),
        np.concatenate([first.raw.arrivals, second.raw.arrivals + np.array([n, gap])]),
        np.array([[later[0] + 0.3, n, n + 20.0]]),
    )
    return Drawn(
        raw, np.r_[first.truth, later], first.treatment,
        frozenset({Fault.RESTARTED, Fault.INTERRUPTED}),
    )  # fmt: skip


def rerouted(random):
    at, longer = START + random.uniform(100, 300), random.uniform(2e-3, 8e-3)
    share = random.uniform(0.0, 1.0)

    def congestion(t, _):
        return (longer * share, longer * (1 - share)) if t > at else (0.0, 0.0)

    return received(
        random, Clock(random), regular(random, 100.0, 400, 900), 100.0, congestion=congestion,
        faults=frozenset({Fault.CONGESTED}), clean=False,
    )  # fmt: skip


def unprobed_minutes(random):
    drawn = received(random, Clock(random), regular(random, 250.0, 500, 800), 250.0)
    begin = START + random.uniform(60, 150)
    local = drawn.raw.probes[:, 3]
    kept = (local < begin) | (local > begin + random.uniform(120, 300))
    raw = RawStream(drawn.raw.stamps, drawn.raw.probes[kept], drawn.raw.arrivals)
    return replace(drawn, raw=raw, faults=frozenset({Fault.PROBES_MISSING}), clean=False)


def wireless(random):
    return received(
        random, Clock(random), regular(random, 250.0), 250.0, way=random.uniform(3e-4, 1e-3),
        reply=random.uniform(1e-3, 4e-3), clean=False,
    )  # fmt: skip


def coarse(random):
    """Stamps of a clock that counts milliseconds, on a grid that is none of theirs."""
    clock = Clock(random)
    times = regular(random, 128.0)
    drawn = received(random, clock, times, 128.0, faults=frozenset({Fault.COARSE}), grid_s=1e-3)
    stamps = np.round(drawn.raw.stamps, 3)
    return replace(drawn, raw=RawStream(stamps, drawn.raw.probes, drawn.raw.arrivals))


def noisy(random):
    """Stamps that scatter about a steady clock, and samples that come as they were taken."""
    times = regular(random, 100.0)
    scatter = random.normal(0.0, random.uniform(1e-3, 3e-3), len(times))
    return received(
        random, Clock(random), times, 100.0, stamped=times + scatter, sent=times + 0.01,
        faults=frozenset({Fault.NOISY}), lag_s=0.02,
    )  # fmt: skip


ROWS: dict[str, Callable] = {
    "500 Hz, single samples lost": lambda r: lost(r, 500.0, 0.001, 0.1),
    "60 Hz, single samples lost": lambda r: lost(r, 60.0, 0.002, 0.1),
    "eye tracker that samples unevenly": eye_tracker,
    "rate changes at once": changed_rate,
    "rate settles while warming": warming,
    "stamps of the receiver's clock": receivers_clock,
    "stamps of another clock altogether": foreign_clock,
    "chunks stamped when sent": chunks,
    "Bluetooth bursts, drops, a counter": lambda r: bluetooth(r, counted=True),
    "chunks out of order": shuffled,
    "markers, wander and step": wandering_markers,
    "500 ppm slew for a minute": lambda r: slewed(r, 300e-6, 700e-6, (30.0, 90.0)),
    "one-way congestion": congested,
    "died after a third": died,
    "stalls and bursts": stalling,
    "Bluetooth bursts, drops, no counter": lambda r: bluetooth(r, counted=False),
    "5000 ppm slew for seconds": lambda r: slewed(r, 3e-3, 5e-3, (8.0, 20.0)),
    "remote computer sleeps": sleeping,
    "restarts with another clock": restarting,
    "route changes": rerouted,
    "minutes without probes": unprobed_minutes,
    "wireless": wireless,
    "stamps in whole milliseconds": coarse,
    "noisy stamps, even samples": noisy,
    "clock jumps": jumping,
    "steady, up to 400 ppm": steady,
}
