"""Ablation of the correction of time stamps: each link of its chain switched off in turn.

    python -m benchmarks.links [--draws 1] [--part 0/2] [--only LINK ...]

The rows are those of benchmarks.sync, and random products of faults. A link is defended by draws
that are worse without it: further off, not covered, or with a fault named wrongly.
"""

import argparse
import functools
import importlib
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

import benchmarks.sync  # noqa: F401 - it puts the tests on the path

SYNC = "labcrane.streams.sync."


def gives(value: Any) -> Callable[[Any], Callable[..., Any]]:
    """Return what replaces a function by one value."""
    return lambda _: lambda *args, **more: value


LINKS: dict[str, tuple[str, str, Callable[[Any], Any]]] = {
    "lost_between": ("stamping.holes", "lost_between", lambda _: lambda i, r, p: (False, p)),
    "rates": ("sampling", "_rates", gives(())),
    "levels": ("stamping.levels", "find", gives(None)),
    "packets": ("stamping.levels", "of_packets", gives(None)),
    "receipt": ("stamping.receipt", "find", gives(None)),
    "computed back": ("stamping.receipt", "_is_computed", gives("")),
    "late": ("stamping.receipt", "_is_late", gives("")),
    "made good": (
        "stamping.holes", "_size",
        lambda _: lambda late, usual, at, k, scatter: float(late[at[k] + 1] - late[at[k]]),
    ),
    "alone": ("stamping.holes", "_alone", lambda _: lambda odd: np.ones(len(odd), bool)),
    "went_back": ("stamping.holes", "went_back", lambda _: lambda late, *a: np.zeros(len(late))),
    "shifts": (
        "stamping.shifts", "find",
        lambda f: lambda by, usual, back, known: f(by, usual, back, np.zeros(len(by), bool)),
    ),

    "noise by arrivals": ("sampling", "_noise", lambda f: lambda t, a, s, g: f(t, None, s, g)),
    "chunks": ("sampling", "_chunks", lambda f: lambda *a: (*f(*a)[:2], False)),
    "coarse unit": ("sampling", "coarse_unit", gives(0.0)),
    "on grid": ("sampling", "_on_grid", gives("")),
    "shuffled": ("sampling", "_is_shuffled", gives("")),
    "set back": ("sampling", "_set_back", gives(0.0)),
    "repeats": ("repeats", "first_of", gives(None)),
    "frozen": ("placement", "_hold_frozen", gives((0, 0))),
    "lags": ("placement", "_lags", lambda _: lambda time, *a, **k: np.zeros(len(time))),
    "ahead": ("placement", "_ahead", gives(0.0)),
    "stamped_by": ("placement", "_stamped_by", gives("")),
    "whose": ("placement", "_whose", lambda _: lambda s, a, la, c: c[0] if c else None),
    "slewed": ("epochs", "_slewed", lambda _: lambda change, *a: np.zeros(len(change), bool)),
    "goes on": ("epochs", "_goes_on", gives("")),
    "another goes on": ("epochs", "_another_goes_on", gives("")),
    "stray probes": ("epochs", "_without_strays", lambda _: lambda probes, jumps: (probes, jumps)),
    "outside": ("offset", "OffsetCurve._outside", lambda _: lambda one: np.zeros(len(one.probes))),
    "own unit": ("offset", "_own_unit", gives(0.0)),
    "steady sampler": ("placement", "_sampler", gives(None)),
    "knees": ("smoother", "_with_knees", lambda _: lambda series: series),
    "own clock": ("own_clock", "OwnClock.of", gives(None)),
}  # fmt: skip


def product(random: np.random.Generator) -> Any:
    """Return a regular stream with some faults at once: of samples, stamps, clock and way."""
    from streams.strangers import Clock, received, regular  # noqa: PLC0415

    from labcrane.streams.sync.correction import Treatment  # noqa: PLC0415

    rate = float(random.choice([60.0, 125.0, 250.0, 500.0]))
    times, clock = regular(random, rate, 100.0, 300.0), Clock(random)
    faulty = random.random(5) < 0.4  # lost, a pause, stamped on receipt, a slower way, a step
    if faulty[0]:
        lost = random.integers(100, len(times) - 100, int(random.integers(1, 20)))
        times = np.delete(times, lost)
    if faulty[1]:
        times = times + (np.arange(len(times)) > len(times) // 2) * random.uniform(0.03, 0.24)
    delay = random.exponential(random.uniform(5e-4, 3e-3), len(times)) if faulty[2] else 0.0 * times
    way = 0.0 * times
    if faulty[3]:
        way = random.uniform(2e-3, 8e-3) * (times - times[0]) / np.ptp(times)
    if faulty[4]:
        clock.step(random.choice([-1, 1]) * random.uniform(0.05, 5.0), np.median(times) + 7.0)
    each = 3e-5 * np.arange(len(times))
    stamped = np.maximum.accumulate(times + delay - each) + each
    how = Treatment(rate, latency_s=float(np.mean(stamped - times)))
    return received(
        random, clock, times, rate, stamped=stamped, sent=stamped + way, treatment=how, clean=False,
        chance=True,
    )  # fmt: skip


@dataclass(frozen=True)
class Found:
    """What a correction makes of a draw, in milliseconds."""

    off: float
    uneven: float
    stated: float
    cover: float
    named: frozenset[Any]


def found(drawn: Any) -> Found:
    """Correct a draw."""
    from labcrane.streams.sync.correction import correct  # noqa: PLC0415
    from labcrane.streams.sync.report.certificate import faults  # noqa: PLC0415

    corrected = correct(drawn.raw, drawn.treatment, drawn.end)
    off = 1e3 * np.abs(corrected.time - drawn.truth)
    uneven = 1e3 * np.abs(corrected.uneven - drawn.truth)
    return Found(
        float(np.quantile(off, 0.95)), float(np.quantile(uneven, 0.95)),
        1e3 * float(np.median(corrected.error)), float(np.mean(off <= 1e3 * corrected.error)),
        faults(corrected.quality, drawn.treatment.rate_hz) - drawn.perhaps,
    )  # fmt: skip


def switched(name: str, draw: Callable[[], Found]) -> Found:
    """Return what comes of a draw without a link."""
    where, path, replaced = LINKS[name]
    owner = importlib.import_module(SYNC + where)
    *inside, last = path.split(".")
    owner = functools.reduce(getattr, inside, owner)
    before = owner.__dict__[last]
    setattr(owner, last, replaced(before))
    try:
        return draw()
    finally:
        setattr(owner, last, before)


def remember(name: str) -> dict[Any, Any]:
    """Let the smoother keep its results: most links leave the probes as they are."""
    module, kept = importlib.import_module(SYNC + name), dict[Any, Any]()
    inner = module.smooth

    def smooth(*args: Any, **more: Any) -> Any:
        knees = id(importlib.import_module(SYNC + "smoother")._with_knees)
        key = (knees, *(np.asarray(one).tobytes() for one in args), str(more))
        if key not in kept:
            kept[key] = inner(*args, **more)
        return kept[key]

    module.smooth = smooth
    return kept


def main() -> int:
    """Print, of each link, the draws that are worse or better without it."""
    from streams.strangers import ALL  # noqa: PLC0415

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--draws", type=int, default=1)
    parser.add_argument("--products", type=int, default=40)
    parser.add_argument("--part", default="0/1")
    parser.add_argument("--only", nargs="*", default=[])
    options = parser.parse_args()
    kept = [remember(name) for name in ("offset", "dejitter", "placement")]
    rows = [(row, seed, ALL[row]) for row in ALL for seed in range(options.draws)]
    rows += [("product", seed, product) for seed in range(options.products)]
    part, parts = map(int, options.part.split("/"))
    for row, seed, draw in rows[part::parts]:
        drawn = draw(np.random.default_rng([seed, *row.encode()]))
        for one in kept:
            one.clear()
        base = found(drawn)
        print(*shown("BASE", row, seed, base, base), sep="\t", flush=True)
        for name in options.only or LINKS:
            without = switched(name, functools.partial(found, drawn))
            if without != base:
                print(*shown(name, row, seed, base, without), sep="\t", flush=True)
    return 0


def shown(name: str, row: str, seed: int, base: Found, one: Found) -> list[str]:
    """Return the columns of a line: with the link and without it, and what is named."""
    pairs = zip((base.off, base.stated, base.cover), (one.off, one.stated, one.cover), strict=True)
    numbers = [f"{before:.3f} > {after:.3f}" for before, after in pairs]
    names = [f"-{fault}" for fault in sorted(base.named - one.named)]
    names += [f"+{fault}" for fault in sorted(one.named - base.named)]
    return [name, row, str(seed), *numbers, ", ".join(names)]


if __name__ == "__main__":
    sys.exit(main())
