"""Samplers that pause and streams with holes, drawn at random, with known truth."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from streams.unkind import START, Clock, Drawn, received, regular

from labcrane.streams.sync.raw import RawStream

MOST_SAMPLES = 40_000
LEAST_S, MOST_S = 0.05, 3.0


@dataclass(frozen=True)
class Paused:
    """A stream whose sampler paused, or of which samples were lost.

    ``missing`` counts the samples that a sampler without holes would have taken in them, ``holes``
    those of more than one and a half periods; ``scatter`` is of the stamps, in periods.
    """

    drawn: Drawn
    missing: int
    holes: int
    longest_s: float
    scatter: float


def pausing(random, *, whole: bool, arrivals: bool, scatter: float | None = None) -> Paused:
    """A steady sampler with holes of 0.05 to 3 s, each of whole periods or of any length.

    Stamps scatter about the samples, or the samples do and are stamped as they were taken.
    """
    rate = float(np.exp(random.uniform(np.log(60.0), np.log(2000.0))))
    count = int(random.uniform(0.3, 1.0) * MOST_SAMPLES)
    own = rate * (1 + random.uniform(-40e-6, 40e-6))
    many = int(random.integers(1, 61))
    longest = random.uniform(0.1, MOST_S)
    holes = random.uniform(LEAST_S, longest, many)
    if whole:
        holes = np.maximum(np.round(holes * own), 1.0) / own
    at = np.sort(random.choice(np.arange(50, count - 50), many, replace=False))
    steps = np.full(count, 1.0 / own)
    steps[at] += holes
    times = START + np.cumsum(steps)
    if scatter is None:  # next to none, as of trackers on USB, or any
        scatter = random.choice([random.uniform(0.0, 3e-4) * rate, random.uniform(0.0, 0.5)])
        scatter = min(float(scatter), 0.5)
    noise = random.uniform(-scatter, scatter, count) / own
    told = {}
    if random.random() < 0.5:
        times = times + noise
    else:
        told = {"stamped": times + noise, "sent": times + 0.01}
    drawn = received(random, Clock(random), times, rate, clean=False, chance=True, **told)
    if not arrivals:
        drawn = replace(drawn, raw=RawStream(drawn.raw.stamps, drawn.raw.probes))
    missing = int(np.round(holes * own).sum())
    big = holes * own > 0.5
    return Paused(drawn, missing, int(big.sum()), float(steps[at].max()), scatter)


def stalling(random, *, arrivals: bool) -> Drawn:
    """A program that stalls, and then takes and sends what it owes, one sample after the other."""
    rate = float(random.choice([60.0, 120.0, 250.0, 1000.0]))
    due = regular(random, rate, 100.0, 200.0)
    each = random.uniform(1e-5, 3e-4)
    waited = np.zeros(len(due))
    for begin in random.uniform(due[0] + 5.0, due[-1] - 10.0, int(random.integers(1, 41))):
        held = (due >= begin) & (due < begin + random.uniform(0.1, 2.0))
        if held.any():
            waited[held] = np.maximum(waited[held], due[held][-1] + 1.0 / rate - due[held])
    one_by_one = each * np.arange(len(due))
    times = np.maximum.accumulate(due + waited - one_by_one) + one_by_one
    drawn = received(random, Clock(random), times, rate, clean=False, chance=True)
    if not arrivals:
        drawn = replace(drawn, raw=RawStream(drawn.raw.stamps, drawn.raw.probes))
    return drawn


ROWS: dict[str, Callable] = {
    f"{what}, {how}": partial(pausing, whole=what == "samples lost", arrivals=how == "arrivals")
    for what in ("pauses", "samples lost")
    for how in ("arrivals", "no arrivals")
}
