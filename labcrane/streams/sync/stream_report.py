"""Report on one stream's time stamps, and what to do where they are not right."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from labcrane.core.findings import Finding, Verdict, worst
from labcrane.recording.foreign_streams import COUNTER_GAP, RESET, RecordedStream
from labcrane.streams.sync.limits import Limits
from labcrane.streams.sync.quality import Quality


@dataclass(frozen=True, slots=True)
class StreamReport:
    """One stream. Times are seconds; NaN where it is not known."""

    name: str
    type: str
    source_id: str
    verdict: Verdict
    samples: int
    nominal_hz: float
    quality: Quality
    findings: tuple[Finding, ...] = ()


def judge_stream(
    recorded: RecordedStream, quality: Quality, limits: Limits, *, required: bool = True
) -> StreamReport:
    """Judge a corrected stream, with what the recorder noted beside it."""
    quality = replace(quality, dropped=max(quality.dropped, _missing(recorded)))
    samples = len(recorded.time_raw)
    header = recorded.header
    if samples == 0:
        findings = [_empty(required=required)]
    else:
        findings = _flow(header.rate_hz, samples, quality, limits)
        findings += _clock(quality, limits) + _certainty(quality)
    findings += _noted(recorded)
    verdict = worst(finding.verdict for finding in findings)
    return StreamReport(
        header.name,
        header.type,
        header.source_id,
        verdict,
        samples,
        header.rate_hz,
        quality,
        tuple(findings),
    )


def _missing(recorded: RecordedStream) -> int:
    """Return how many samples the source's own counter left out while it was recorded."""
    gaps = [note.data for note in recorded.notes if note.data.get("event") == COUNTER_GAP]
    return sum(int(gap["missing"]) for gap in gaps)


def _empty(*, required: bool) -> Finding:
    return Finding(
        Verdict.FAIL if required else Verdict.WARN,
        "no sample came",
        "start the acquisition in its program first; check that TCP passes the firewall",
    )


def _flow(nominal: float, samples: int, quality: Quality, limits: Limits) -> list[Finding]:
    """Judge whether all samples are there."""
    found: list[Finding] = []
    if nominal > 0:
        off = abs(quality.rate_hz / nominal - 1.0)
        _add(
            found,
            limits.rate.judge(off),
            f"{quality.rate_hz:.2f} Hz instead of {nominal:g} Hz",
            "check the rate set in the device's program, and whether it drops samples",
        )
        if not np.isnan(quality.lag_s):
            _add(
                found,
                limits.lag_s.judge(abs(quality.lag_s)),
                f"its stamps lie {quality.lag_s:.3f} s before their arrival",
                "its program may stamp with a clock of its own: let it use LSL's",
            )
        _add(
            found,
            limits.gap_s.judge(quality.longest_gap_s),
            f"{quality.gaps} gaps, the longest {quality.longest_gap_s:.3f} s",
            "check the device's cable, radio link and battery; leave out the trials they touch",
        )
    _add(
        found,
        limits.missing.judge(quality.dropped / (samples + quality.dropped)),
        f"{quality.dropped} samples are missing by the source's counter",
        "check the link between device and its program",
    )
    return found


def _clock(quality: Quality, limits: Limits) -> list[Finding]:
    """Judge the source's clock and the way to it."""
    found: list[Finding] = []
    if np.isnan(quality.rtt_p50_s):
        text = "its clock was never probed"
        _add(found, Verdict.FAIL, text, "let UDP pass the firewall of both computers")
        return found
    _add(
        found,
        limits.drift_ppm.judge(abs(quality.drift_ppm)),
        f"its clock runs {quality.drift_ppm:+.0f} ppm off",
        "corrected; but check that the computer's clock is not being adjusted meanwhile",
    )
    _add(
        found,
        limits.residual_s.judge(quality.residual_s),
        f"its clock scatters by {1e3 * quality.residual_s:.3f} ms",
        "use a cable instead of WiFi, and switch off power saving on its computer",
    )
    _add(
        found,
        limits.rtt_s.judge(quality.rtt_p95_s),
        f"clock probes take {1e3 * quality.rtt_p95_s:.2f} ms, so that "
        f"{500 * quality.rtt_p95_s:.2f} ms may be hidden",
        "use a cable instead of WiFi, on the same switch",
    )
    _add(
        found,
        limits.probe_age_s.judge(quality.probe_age_s),
        f"up to {quality.probe_age_s:.0f} s without a clock probe",
        "check whether the network or the computer was interrupted",
    )
    return found


def _certainty(quality: Quality) -> list[Finding]:
    """Judge whether every sample is known to be of one clock."""
    found: list[Finding] = []
    if quality.unprobed:
        _add(
            found,
            Verdict.FAIL,
            f"{quality.unprobed} samples are of a clock that was never probed",
            "leave them out where milliseconds matter: they are placed by their arrival",
        )
    if quality.unsure:
        _add(
            found,
            Verdict.WARN,
            f"{quality.unsure} samples are near a step of the clock and may be of either side",
            "leave out the trial they are in where milliseconds matter",
        )
    return found


def _noted(recorded: RecordedStream) -> list[Finding]:
    """Return what the recorder noticed."""
    found: list[Finding] = []
    resets = sum(note.data.get("event") == RESET for note in recorded.notes)
    if resets:
        _add(
            found,
            Verdict.WARN,
            f"its program was restarted {resets} times",
            "corrected; look why it stopped",
        )
    for text in {str(note.data["text"]) for note in recorded.notes if _is_warning(note.data)}:
        _add(found, Verdict.WARN, text.partition(": ")[0], text.partition(": ")[2] or "correct it")
    return found


def _is_warning(data: Mapping[str, Any]) -> bool:
    return data.get("event") == "warning" and "text" in data


def _add(found: list[Finding], verdict: Verdict, text: str, advice: str) -> None:
    if verdict is not Verdict.PASS:
        found.append(Finding(verdict, text, advice))
