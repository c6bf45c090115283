"""Sync report of a session: how right its time stamps are, what to do where they are not.

It says too of which movements the operator was shown too little.

Made at the end of a session, before the participant leaves; kept in the participant file.
"""

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Protocol

import numpy as np

from labcrane.core.findings import Finding, Verdict, worst
from labcrane.recording.journal import finite
from labcrane.streams.sync.report.limits import Limits
from labcrane.streams.sync.report.loop_back import LoopBack
from labcrane.streams.sync.report.stream_report import StreamReport
from labcrane.streams.sync.terms import MEANS
from labcrane.types import FloatArray

COLUMNS = (
    "stream",
    "verdict",
    "samples",
    "rate Hz",
    "gaps",
    "drift ppm",
    "±95 % ms",
    "worst ms",
    "carries",
)


@dataclass(frozen=True, slots=True)
class LoopReport:
    """How punctual the session's loop was. Times are seconds."""

    verdict: Verdict
    ticks: int
    late: int
    dropped: int
    lateness_p50_s: float
    lateness_p99_s: float
    lateness_max_s: float
    findings: tuple[Finding, ...] = ()


class _Judged(Protocol):
    @property
    def verdict(self) -> Verdict: ...


@dataclass(frozen=True, slots=True)
class SyncReport:
    """All streams and the loop.

    Attributes
    ----------
    streams, loop
        What was recorded; no loop where its clock was moved by hand.
    missing
        Findings on streams that never came.
    absent
        Streams that are not there in a rehearsal, by label: nothing of them can have failed.
    presented
        Findings on movements of which the operator was shown too little.
    interrupted
        Findings on movements that were paused after a view or sound had failed.
    loop_back
        What photodiodes and microphones show of the streams that recorded them.
    """

    streams: tuple[StreamReport, ...]
    loop: LoopReport | None = None
    missing: tuple[Finding, ...] = field(default_factory=tuple)
    absent: tuple[str, ...] = ()
    presented: tuple[Finding, ...] = ()
    interrupted: tuple[Finding, ...] = ()
    loop_back: tuple[LoopBack, ...] = ()

    @property
    def verdict(self) -> Verdict:
        """The worst of all."""
        return worst([self.of_stamps, *(one.verdict for one in self._of_feedback)])

    @property
    def _of_feedback(self) -> tuple[Finding, ...]:
        return (*self.presented, *self.interrupted)

    @property
    def of_stamps(self) -> Verdict:
        """The worst of what was found of time stamps."""
        judged: list[Iterable[_Judged]] = [self.streams, self.missing, self.loop_back]
        if self.loop is not None:
            judged.append([self.loop])
        return worst(one.verdict for each in judged for one in each)

    def as_json(self) -> dict[str, Any]:
        """Return what JSON can hold; what is not known is null."""
        plain = {name: finite(each) for name, each in asdict(self).items()}
        for name in ("absent", "presented", "interrupted", "loop_back"):
            if not plain[name]:  # as in recordings of before
                del plain[name]
        return {"verdict": self.verdict.value, **plain}

    def table(self) -> list[tuple[str, ...]]:
        """Return a row of text per stream, in the order of ``COLUMNS``."""
        return [_row(one) for one in self.streams]

    def advice(self) -> list[str]:
        """Return what is not as it should be, one line each, the worst first."""
        found = [("", finding) for finding in self.missing]
        found += [(f"{one.name}: ", finding) for one in self.streams for finding in one.findings]
        if self.loop is not None:
            found += [("loop: ", finding) for finding in self.loop.findings]
        found += [("feedback: ", finding) for finding in self._of_feedback]
        found += [(f"{one.stream}: ", each) for one in self.loop_back for each in one.findings]
        order = list(Verdict)
        found.sort(key=lambda pair: -order.index(pair[1].verdict))
        return [f"{f.verdict} {whose}{f.text}; {f.advice}" for whose, f in found]

    def details(self) -> list[str]:
        """Return what was done to each stream's stamps, what stays unknown, what terms mean."""
        named = {name for one in self.streams for name in one.quality.made_of_s}
        found = [
            f"{one.name}: {'; '.join(filter(None, (one.taken, *one.corrected, one.unknown)))}"
            for one in self.streams
            if one.samples
        ] + [f"{one.stream}: {one.in_words()}" for one in self.loop_back]
        return found + [f"{name}: {means}" for name, means in MEANS.items() if name in named]


def judge_loop(
    due: FloatArray, woke: FloatArray, rate_hz: float, limits: Limits, dropped: int = 0
) -> LoopReport:
    """Judge the loop by when its ticks were due and when it woke, shape ``(n_ticks,)``.

    ``dropped`` counts ticks that are missing in the record.
    """
    lateness = np.asarray(woke - due)
    late = int(np.count_nonzero(lateness > 1.0 / rate_hz))
    findings = []
    if (verdict := limits.late.judge(late / max(len(due), 1))) is not Verdict.PASS:
        text = f"{late} of {len(due)} ticks woke more than {1e3 / rate_hz:.1f} ms late"
        findings.append(Finding(verdict, text, "close other programs, or lower the rate"))
    if dropped:
        text = f"{dropped} ticks are missing from the record"
        findings.append(Finding(Verdict.FAIL, text, "run labcrane recover and read its output"))
    p50, p99, most = np.quantile(lateness, (0.5, 0.99, 1.0)) if len(due) else (np.nan,) * 3
    verdict = worst(finding.verdict for finding in findings)
    return LoopReport(
        verdict, len(due), late, dropped, float(p50), float(p99), float(most), tuple(findings)
    )


def never_came(labels: Mapping[str, bool]) -> tuple[Finding, ...]:
    """Return findings on streams that never came: by label, whether each is required."""
    return tuple(
        Finding(
            Verdict.FAIL if required else Verdict.WARN,
            f"{label} was never on the network",
            "start its program, enable LSL in it, and check network and firewall",
        )
        for label, required in labels.items()
    )


def _row(one: StreamReport) -> tuple[str, ...]:
    quality = one.quality
    return (
        one.name,
        one.verdict.value,
        str(one.samples),
        _number(quality.rate_hz, ".2f"),
        f"{quality.gaps}" + (f" ({quality.longest_gap_s:.2f} s)" if quality.gaps else ""),
        _number(quality.drift_ppm, "+.1f"),
        _number(1e3 * quality.error_p95_s, ".3f"),
        _number(1e3 * quality.worst_s, ".2f"),
        one.carries,
    )


def _number(value: float, form: str) -> str:
    return format(value, form) if np.isfinite(value) else "-"
