"""Scores of corrections of unkind devices: error, coverage, verdict, named faults."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student
from streams.strangers import ALL
from streams.unkind import Drawn

from labcrane.core import Verdict
from labcrane.core.findings import worst
from labcrane.streams.sync.correction import correct
from labcrane.streams.sync.report.certificate import Fault, faults
from labcrane.streams.sync.report.limits import Limits
from labcrane.streams.sync.report.stream_report import judge_quality


@dataclass(frozen=True)
class Score:
    """One draw. Milliseconds.

    ``apart`` and ``usual_apart`` are ``p95`` and ``usual`` beside what a lasting asymmetry hides.
    """

    row: str
    p95: float
    most: float
    cover: float
    width: float
    passed: bool
    usual: float
    untouched: float
    named: frozenset[Fault]
    present: frozenset[Fault]
    clean: bool
    limit: float
    samples: int
    apart: float
    usual_apart: float
    apart_limit: float
    chance: bool
    lag: float = 0.0
    stated: float = np.inf


def draw(row: str, seed: int) -> Drawn:
    return ALL[row](np.random.default_rng([seed, *row.encode()]))


def score(row: str, seed: int, *, usual: bool = False) -> Score:
    drawn = draw(row, seed)
    corrected = correct(drawn.raw, drawn.treatment, drawn.end)
    error, apart = (
        1e3 * np.abs(corrected.time - drawn.truth - hidden) for hidden in (0.0, drawn.hidden_s)
    )
    usual_times = as_pyxdf(drawn) if usual else np.full(len(error), np.nan)
    theirs, theirs_apart = (
        1e3 * float(np.quantile(np.abs(usual_times - drawn.truth - hidden), 0.95))
        for hidden in (0.0, drawn.hidden_s)
    )
    named = faults(corrected.quality, drawn.treatment.rate_hz) - drawn.perhaps
    raw = 1e3 * np.abs(drawn.raw.stamps - drawn.treatment.latency_s - drawn.truth)
    q = corrected.quality
    verdict = worst(
        one.verdict
        for one in judge_quality(q, drawn.treatment.rate_hz, len(error), Limits(), required=True)
    )

    return Score(
        row, float(np.quantile(error, 0.95)), float(error.max()),
        float(np.mean(error <= 1e3 * corrected.error)), 1e3 * float(np.median(corrected.error)),
        verdict is Verdict.PASS, theirs,
        float(np.quantile(raw, 0.95)), named, drawn.faults, drawn.clean, drawn.limit_ms, len(error),
        float(np.quantile(apart, 0.95)), theirs_apart, drawn.apart_ms,
        drawn.chance, 1e3 * (drawn.lag_s + drawn.grid_s + drawn.uneven_s),
        1e3 * float(np.quantile(corrected.error, 0.95)),
    )  # fmt: skip


def as_pyxdf(drawn: Drawn) -> np.ndarray:
    """Return the times that pyxdf makes of LabRecorder's offsets."""
    from pyxdf import pyxdf as theirs

    raw, truth = drawn.raw, drawn.truth
    if not len(raw.probes):  # without offsets it leaves stamps as they are
        return raw.stamps - drawn.treatment.latency_s
    local = np.arange(truth[0] + 1.0, truth[-1], 5.0)
    told = raw.probes[np.argsort(raw.probes[:, 3])]
    k = np.clip(np.searchsorted(told[:, 3], local) - 1, 0, len(told) - 1)
    value = told[k, 1]
    stream = theirs.StreamData.__new__(theirs.StreamData)
    stream.stream_id = 1
    stream.time_stamps = raw.stamps.copy()
    stream.clock_times = list(local - value)
    stream.clock_values = list(value)
    stream.time_series = np.zeros((len(raw.stamps), 1))
    rate = drawn.treatment.rate_hz
    stream.nominal_srate = rate
    stream.srate = rate
    stream.tdiff = 1.0 / rate if rate else 0.0
    stream.fmt = "double64"
    stream.nchns = 1
    stream.effective_srate = 0.0
    stream.segments = []
    stream.clock_segments = []
    streams = theirs._clock_sync({1: stream})
    streams = theirs._jitter_removal(streams)
    return np.asarray(streams[1].time_stamps - drawn.treatment.latency_s)


WORSE_MS = 0.1
"""By how much the correction may be worse than none, or than pyxdf's."""

FEWEST_FOR_WORST = 20
"""How many draws show the worst of twenty."""


def shortcomings(one: Score) -> list[str]:
    """Return which promises a draw breaks."""
    found = []
    if one.clean and one.p95 > one.limit:
        found.append(f"error beyond {one.limit} ms")
    if one.p95 > one.untouched + WORSE_MS:
        found.append("worse than no correction")
    # What a lasting asymmetry hides is in both, and the errors of either may cancel it by luck.
    if not one.chance and one.apart > one.usual_apart + WORSE_MS:
        found.append("worse than pyxdf")
    if one.apart > one.apart_limit:
        found.append(f"error beyond {one.apart_limit} ms beside what is hidden")
    if one.cover < 0.95:
        found.append("not covered")
    if one.clean and one.width > 0.3 + one.lag:
        found.append("uncertainty wider than 0.3 ms")
    if one.passed and one.most > 1.0:
        found.append("PASS beyond 1 ms")
    return found


def table_line(found: list[Score]) -> str:
    """Return a row's line of the table in docs/reference/accuracy.md. Milliseconds."""
    error = np.mean([one.p95 for one in found])
    usual = np.mean([one.usual for one in found])
    return (
        f"| {found[0].row} | {error:.3f} ({max(one.p95 for one in found):.3f}) | "
        f"{np.median([one.width for one in found]):.3f} | "
        f"{100.0 * min(one.cover for one in found):.1f} % | {usual:.3g} | "
        f"{sum(one.passed for one in found)} of {len(found)} |"
    )


def worse_rows(scores: list[Score]) -> list[str]:
    """Return the rows whose error is larger than pyxdf's over all draws, none of them left out.

    The mean is compared, and the worst of twenty draws. Where chance decides in each draw which of
    the two is right (a coarse unit, delays of both ways that differ all along), the mean may be
    larger by what such a mean scatters, at 95 %, and fewer than twenty draws show no worst one.
    """
    found = []
    for row in dict.fromkeys(one.row for one in scores):
        draws = [one for one in scores if one.row == row]
        ours, usual = np.array([(one.p95, one.usual) for one in draws]).T
        worse = [np.mean(ours - usual) - WORSE_MS]
        by_chance = any(one.chance for one in draws)
        if by_chance:
            worse[0] -= _scatter_of_mean(ours - usual)
        if not by_chance or len(draws) >= FEWEST_FOR_WORST:
            worse.append(np.quantile(ours, 0.95) - np.quantile(usual, 0.95) - WORSE_MS)
        if max(worse) > 0.0:
            found.append(row)
    return found


def coverage(scores: list[Score]) -> float:
    """Return which part of all samples the stated uncertainty covers."""
    total = sum(one.samples for one in scores)
    return sum(one.cover * one.samples for one in scores) / total


def misnamed(scores: list[Score]) -> dict[Fault, tuple[float, float]]:
    """Return precision and recall of every fault that is present anywhere or named."""
    found = {}
    for fault in Fault:
        named = sum(fault in one.named for one in scores)
        present = sum(fault in one.present for one in scores)
        both = sum(fault in one.named and fault in one.present for one in scores)
        if named or present:
            found[fault] = (both / named if named else 1.0, both / present if present else 1.0)
    return found


def _scatter_of_mean(differences: np.ndarray) -> float:
    """Return by how much their mean is larger than the true one in a twentieth of all cases."""
    if len(differences) < 2:
        return np.inf
    error = np.std(differences, ddof=1) / np.sqrt(len(differences))
    return float(error * student.ppf(0.95, len(differences) - 1))
