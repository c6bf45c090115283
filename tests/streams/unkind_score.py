"""Scores of corrections of unkind devices: error, coverage, verdict, named faults."""

from dataclasses import dataclass

import numpy as np
from streams.unkind import ROWS, Drawn

from labcrane.core.findings import Verdict, worst
from labcrane.streams.sync.correction import correct
from labcrane.streams.sync.report.certificate import Fault, faults
from labcrane.streams.sync.report.limits import Limits
from labcrane.streams.sync.report.stream_report import judge_quality


@dataclass(frozen=True)
class Score:
    """One draw. Milliseconds."""

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
    hidden: float


def draw(row: str, seed: int) -> Drawn:
    return ROWS[row](np.random.default_rng([seed, *row.encode()]))


def score(row: str, seed: int, *, usual: bool = False) -> Score:
    drawn = draw(row, seed)
    corrected = correct(drawn.raw, drawn.treatment, drawn.end)
    error = 1e3 * np.abs(corrected.time - drawn.truth)
    named = faults(corrected.quality, drawn.treatment.rate_hz)
    raw = 1e3 * np.abs(drawn.raw.stamps - drawn.treatment.latency_s - drawn.truth)
    q = corrected.quality
    verdict = worst(
        one.verdict
        for one in judge_quality(q, drawn.treatment.rate_hz, len(error), Limits(), required=True)
    )

    return Score(
        row, float(np.quantile(error, 0.95)), float(error.max()),
        float(np.mean(error <= 1e3 * corrected.error)), 1e3 * float(np.median(corrected.error)),
        verdict is Verdict.PASS, as_pyxdf(drawn) if usual else np.nan,
        float(np.quantile(raw, 0.95)), named, drawn.faults, drawn.clean, drawn.limit_ms, len(error),
        1e3 * q.hidden_s if np.isfinite(q.hidden_s) else 0.0,
    )  # fmt: skip


def as_pyxdf(drawn: Drawn) -> float:
    """Return the 95th percentile of the error of LabRecorder's offsets and pyxdf's way."""
    from pyxdf import pyxdf as theirs

    raw, truth = drawn.raw, drawn.truth
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
    times = streams[1].time_stamps - drawn.treatment.latency_s
    return 1e3 * float(np.quantile(np.abs(times - truth), 0.95))


WORSE_MS = 0.1
"""By how much the correction may be worse than none, or than pyxdf's."""


def shortcomings(one: Score) -> list[str]:
    """Return which promises a draw breaks."""
    found = []
    if one.clean and one.p95 > one.limit:
        found.append(f"error beyond {one.limit} ms")
    if one.p95 > one.untouched + WORSE_MS:
        found.append("worse than no correction")
    # Half the shortest round trip nobody can know; others' errors may cancel it by luck.
    if one.p95 > one.usual + WORSE_MS + one.hidden:
        found.append("worse than pyxdf")
    if one.cover < 0.95:
        found.append("not covered")
    if one.clean and one.width > 0.3:
        found.append("uncertainty wider than 0.3 ms")
    if one.passed and one.most > 1.0:
        found.append("PASS beyond 1 ms")
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
