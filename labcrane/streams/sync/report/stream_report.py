"""Report on one stream's time stamps, and what to do where they are not right."""

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from labcrane.core.findings import Finding, Verdict, worst
from labcrane.recording.foreign_streams import (
    COUNTER_GAP,
    RESET,
    TAKEN,
    UNSTAMPED,
    RecordedStream,
)
from labcrane.recording.own_streams import ESTIMATED, stated_terms
from labcrane.recording.pictures import CAPTURED
from labcrane.streams.probes import FASTER
from labcrane.streams.sync.quality import Quality
from labcrane.streams.sync.raw import ASSUMED_RTT_S
from labcrane.streams.sync.report.certificate import (
    CONGESTED_S,
    carries,
    corrections,
    faults,
    unknowable,
)
from labcrane.streams.sync.report.limits import Limits
from labcrane.streams.sync.terms import in_words

FURTHEST = 3.0
"""The furthest of many samples lie so much further off than 95 % of them do."""


@dataclass(frozen=True, slots=True)
class StreamReport:
    """One stream. Times are seconds; NaN where it is not known.

    Attributes
    ----------
    faults
        What is wrong with its samples or clocks, by name, whether corrected or not.
    corrected
        What was done to its stamps, one sentence each.
    unknown
        What no software can know of them.
    carries
        Which analyses its stamps carry.
    taken
        Which stream it is, where any of its type was meant.
    """

    name: str
    type: str
    source_id: str
    verdict: Verdict
    samples: int
    nominal_hz: float
    quality: Quality
    findings: tuple[Finding, ...] = ()
    faults: tuple[str, ...] = ()
    corrected: tuple[str, ...] = ()
    unknown: str = ""
    carries: str = ""
    taken: str = ""


def judge_stream(
    recorded: RecordedStream, quality: Quality, limits: Limits, *, required: bool = True
) -> StreamReport:
    """Judge a corrected stream, with what the recorder noted beside it."""
    quality = replace(quality, dropped=max(quality.dropped, _missing(recorded)))
    samples = len(recorded.time_raw)
    header = recorded.header
    captured = header.name.startswith(CAPTURED)
    own = captured or bool(stated_terms(header.name))
    if samples == 0:
        findings = [_empty(header.name, required=required)]
    elif captured:
        findings = _captured(quality, samples, limits, required=required)
    elif own:  # whether there are values is in every tick
        findings = _findings(_certainty(quality, limits))
    else:
        findings = judge_quality(quality, header.rate_hz, samples, limits, required=required)
    findings += _findings(_noted(recorded), _unwritten(recorded))
    unknown = unknowable(quality) if _probed_in_full(recorded) else UNWRITTEN
    if own:
        unknown = "the lag of its device, beyond what is declared"
    return StreamReport(
        header.name,
        header.type,
        header.source_id,
        worst(finding.verdict for finding in findings),
        samples,
        header.rate_hz,
        quality,
        tuple(findings),
        tuple(sorted(faults(quality, header.rate_hz))) if samples else (),
        tuple(corrections(quality)),
        unknown,
        carries(quality) + ("" if len(recorded.arrivals) or not samples else IF_ITS_OWN),
        _taken(recorded),
    )


def uncorrected_stream(recorded: RecordedStream, why: str) -> StreamReport:
    """Return the report of a stream whose times could not be corrected."""
    header, samples, quality = recorded.header, len(recorded.time_raw), Quality()
    finding = Finding(
        Verdict.FAIL,
        f"its clock could not be corrected: {why}",
        "its times are uncorrected; after mending the cause, run labcrane resync",
    )
    return StreamReport(
        header.name,
        header.type,
        header.source_id,
        Verdict.FAIL,
        samples,
        header.rate_hz,
        quality,
        (finding, *_findings(_noted(recorded))),
        unknown=unknowable(quality),
        carries=carries(quality),
        taken=_taken(recorded),
    )


def _probed_in_full(recorded: RecordedStream) -> bool:
    """Whether the round trips of its probes were recorded, if it was probed."""
    return bool(len(recorded.probes)) or not len(recorded.offsets)


UNWRITTEN = (
    "the round trips of its probes were not recorded: a lasting asymmetry of the network may hide "
    "half of the shortest round trip, which is unknown"
)
IF_ITS_OWN = ", if they are of the clock that was probed, which nothing shows"


_Judged = Iterator[tuple[Verdict, str, str]]
"""Verdict, what was found, what to do."""


def judge_quality(
    quality: Quality, nominal: float, samples: int, limits: Limits, *, required: bool = True
) -> list[Finding]:
    """Judge corrected times by themselves."""
    return _findings(
        _flow(nominal, samples, quality, limits),
        _stamping(quality, limits),
        _order(quality),
        _scatter(quality, limits),
        _died(quality, nominal, limits, required=required),
        _clock(quality, limits),
        _changes(quality),
        _certainty(quality, limits),
    )


def _findings(*judged: _Judged) -> list[Finding]:
    each = itertools.chain.from_iterable(judged)
    return [Finding(*one) for one in each if one[0] is not Verdict.PASS]


def _captured(quality: Quality, samples: int, limits: Limits, *, required: bool) -> list[Finding]:
    """Judge the frames of a recording, whose times are on the session's clock already."""
    flow = _flow(0.0, samples, quality, limits)
    died = _died(quality, 0.0, limits, required=required)
    if not np.isnan(quality.error_p95_s):
        return _findings(flow, died, _certainty(quality, limits))
    text = "the lag of its device is not declared, so that the uncertainty of its times is unknown"
    advice = "measure the lag, and write lag_s and lag_error_s into the protocol"
    return [*_findings(flow, died), Finding(Verdict.WARN, text, advice)]


def _missing(recorded: RecordedStream) -> int:
    """Return how many samples the source's own counter left out while it was recorded."""
    gaps = [note.data for note in recorded.notes if note.data.get("event") == COUNTER_GAP]
    return sum(int(gap["missing"]) for gap in gaps)


def _empty(name: str, *, required: bool) -> Finding:
    advice = "start the acquisition in its program first; check that TCP passes the firewall"
    if name.startswith(ESTIMATED):
        advice = "read why in the events estimate.failed; try its plugin with labcrane.testing"
    return Finding(Verdict.FAIL if required else Verdict.WARN, "no sample came", advice)


def _flow(nominal: float, samples: int, quality: Quality, limits: Limits) -> _Judged:
    """Judge whether all samples are there."""
    if nominal > 0:
        off = abs(quality.rate_hz / nominal - 1.0)
        text = f"{quality.rate_hz:.2f} Hz instead of {nominal:g} Hz"
        if np.isnan(off):
            text = f"its {samples} samples do not show at which rate it samples"
        advice = "check the rate set in the device's program, and whether it drops samples"
        yield limits.rate.judge(off), text, advice
        if not np.isnan(quality.first_rate_hz):
            text = f"its rate changed from {quality.first_rate_hz:.3f} to "
            text += f"{quality.last_rate_hz:.3f} Hz"
            advice = "its timestamps were not dejittered; let the device warm up before you record"
            yield Verdict.WARN, text, advice
    text = f"{quality.gaps} gaps, the longest {quality.longest_gap_s:.3f} s"
    advice = "check the device's cable, radio link and battery; exclude the affected trials"
    yield limits.gap_s.judge(quality.longest_gap_s), text, advice
    text = f"{quality.dropped} samples are missing, by its counter or by its timestamps"
    missing = limits.missing.judge(quality.dropped / (samples + quality.dropped))
    yield missing, text, "check the link between device and its program"
    if quality.uncounted:
        text = "its timestamps scatter by too much to count single lost samples"
        yield Verdict.WARN, text, "let its program send a counter, and name it in the study"


def _stamping(quality: Quality, limits: Limits) -> _Judged:
    """Judge by which clock samples were stamped, and whether that delay changed."""
    if quality.whose == "receiver":
        text = "its timestamps are from this computer's clock already, but its own clock was probed"
        yield Verdict.FAIL, text, "let its program push LSL's timestamps unchanged"
    elif quality.whose == "foreign":
        text = f"its timestamps are from a clock that LSL does not know ({quality.lag_s:.3f} s off)"
        yield Verdict.FAIL, text, "its program must stamp with LSL's clock, not its own"
    elif not np.isnan(quality.lag_s):
        text = f"its timestamps are {quality.lag_s:.3f} s before their arrival"
        advice = "its program may stamp with a clock of its own: let it use LSL's"
        yield limits.lag_s.judge(abs(quality.lag_s)), text, advice
    if quality.ahead_s:
        text = f"it is stamped up to {1e3 * quality.ahead_s:.1f} ms ahead: with a future time, "
        text += "or by a clock that is ahead"
        advice = "correct if its program stamps with the coming flip; compare it with a photodiode"
        yield Verdict.WARN, text, advice
    if quality.shifts:
        text = f"{quality.shifts} times its timestamps shifted, by {1e3 * quality.shift_s:.0f} ms "
        text += "at most: it paused, its delay changed, or its clock was set"
        advice = "samples before and after may be off by that much; they are not moved"
        yield Verdict.WARN, text, advice


def _order(quality: Quality) -> _Judged:
    """Judge whether samples came one after the other, and in time."""
    if quality.backward and not quality.disordered:
        text = f"{quality.backward} samples are placed before one that arrived earlier: sent late "
        text += "or again, its buffer changed, or its clock was set back"
        yield Verdict.WARN, text, "exclude the trials they are in; check its program"
    if quality.disordered:
        text = f"{quality.disordered} samples came out of order"
        yield Verdict.WARN, text, "sort by time before you use them; find why they overtake"
    if quality.frozen:
        text = f"{quality.frozen} samples have the timestamp of the one before"
        yield Verdict.WARN, text, "exclude the trials they are in; check its program"
    if quality.stalls:
        text = f"{quality.stalls} times it stalled and sent late, by "
        text += f"{quality.longest_stall_s:.1f} s at most"
        advice = "its times are correct; feedback that used it was late: find what delayed its "
        yield Verdict.WARN, text, advice + "program"


def _scatter(quality: Quality, limits: Limits) -> _Judged:
    """Judge how far stamps lie beside an even count."""
    if quality.grid_s:
        unit = f"{1e3 * quality.grid_s:g} ms"
        text = f"its timestamps are cut to {unit}; their uncertainty includes half of that, or all"
        yield Verdict.WARN, text, "let its program stamp with LSL's clock at full resolution"
    if quality.contradicted:
        text = f"its timestamps are {quality.contradicted}, though it is declared to be stamped "
        text += "at sampling: the declaration was not used"
        yield Verdict.WARN, text, "remove stamped: at_sampling, or stamp each sample"
    if quality.late_stamps:
        text = f"chunks are stamped when they are sent ({1e3 * quality.noise_s:.1f} ms of scatter)"
        yield Verdict.WARN, text, "measure the delay and give it as latency_s or min_delay_s"
    elif quality.noise_s:
        text = f"its timestamps scatter by {1e3 * quality.noise_s:.2f} ms about its samples"
        yield Verdict.WARN, text, "let its program stamp with LSL's clock at full resolution"
    elif quality.uneven_s > limits.error_s.warn / FURTHEST:
        text = f"its timestamps are up to {1e3 * quality.uneven_s:.2f} ms off a regular grid: "
        text += "its samples are irregular, or late by as much; both look alike"
        yield Verdict.WARN, text, "if its sampler is steady, let its program stamp sooner"


def _died(quality: Quality, nominal: float, limits: Limits, *, required: bool) -> _Judged:
    if limits.silent_s.judge(quality.silent_s) is not Verdict.PASS:
        what = "sample came" if nominal > 0.0 else "sample came and no probe was answered"
        text = f"it died: no {what} in the last {quality.silent_s:.0f} s"
        advice = "exclude the trials after its last sample; check its program and its battery"
        yield Verdict.FAIL if required else Verdict.WARN, text, advice


def _clock(quality: Quality, limits: Limits) -> _Judged:
    """Judge the source's clock and the way to it."""
    if np.isnan(quality.rtt_p50_s):
        text = "its clock was never probed"
        yield Verdict.FAIL, text, "let UDP pass the firewall of both computers"
        return
    text = f"its clock runs {quality.drift_ppm:+.0f} ppm off"
    advice = "corrected; but check that the computer's clock is not being adjusted meanwhile"
    yield limits.drift_ppm.judge(abs(quality.drift_ppm)), text, advice
    text = f"its clock scatters by {1e3 * quality.residual_s:.3f} ms"
    yield limits.residual_s.judge(quality.residual_s), text, FASTER
    text = f"clock probes take {1e3 * quality.rtt_p95_s:.2f} ms, so that "
    text += f"{500 * quality.rtt_p95_s:.2f} ms may be hidden"
    yield limits.rtt_s.judge(quality.rtt_p95_s), text, FASTER
    text = f"up to {quality.probe_age_s:.0f} s without a clock probe"
    advice = "check whether the network or the computer was interrupted"
    yield limits.probe_age_s.judge(quality.probe_age_s), text, advice


def _changes(quality: Quality) -> _Judged:
    """Name what happened to its clock and on the way to it."""
    for count, what, advice in (
        (quality.steps, "its clock jumped {} times", "find what sets its computer's clock"),
        (quality.sleeps, "its computer slept {} times", "switch off its power saving"),
        (quality.slews, "a clock was slewed {} times", "switch off NTP while you record"),
    ):
        if count:
            yield Verdict.WARN, what.format(count), f"corrected; {advice}"
    if quality.congested_s > CONGESTED_S:
        text = f"probes were delayed for {quality.congested_s:.0f} s"
        advice = "the uncertainty includes it; reserve the network for the study"
        yield Verdict.WARN, text, advice


def _certainty(quality: Quality, limits: Limits) -> _Judged:
    """Judge how well every sample's time is known."""
    text = f"its times may be off by {in_words(quality.error_p95_s, quality.made_of_s)}"
    advice = f"they are accurate enough for {carries(quality)}"
    yield limits.error_s.judge(quality.error_p95_s), text, advice
    if not quality.error_p95_s > limits.error_s.warn and quality.worst_s > limits.error_s.warn:
        text = f"its times may be off by {1e3 * quality.worst_s:.2f} ms in the second from "
        text += f"{quality.worst_at_s:.0f} s"
        yield Verdict.WARN, text, "exclude the trial it is in if milliseconds matter"
    if quality.unprobed and not quality.whose:
        text = f"{quality.unprobed} samples are from a clock that was never probed"
        advice = "exclude them if milliseconds matter: only their arrival, if recorded, places them"
        yield Verdict.FAIL, text, advice
    if quality.unsure:
        text = f"{quality.unsure} samples are near a step of the clock and may be of either side"
        yield Verdict.WARN, text, "exclude the trial they are in if milliseconds matter"


def _unwritten(recorded: RecordedStream) -> _Judged:
    """Report what another recorder did not write, and what stays unknown without it."""
    if len(recorded.time_raw) and not len(recorded.arrivals):
        text = "its arrival times were not recorded, so nothing shows from which clock its "
        text += "timestamps are, or how late they are"
        yield Verdict.WARN, text, "compare it with an event that another stream contains too"
    if len(recorded.offsets) and not len(recorded.probes):
        text = f"its clock probes' round trips were not recorded; {1e3 * ASSUMED_RTT_S:g} ms is "
        text += "assumed, and a slower network hides more"
        yield Verdict.WARN, text, "measure the round trip between the two computers"


def _noted(recorded: RecordedStream) -> _Judged:
    """Return what the recorder noticed."""
    resets = sum(note.data.get("event") == RESET for note in recorded.notes)
    if resets:
        text = f"its program was restarted {resets} times"
        yield Verdict.WARN, text, "corrected; find why it stopped"
    rest = set[int]()
    for note in recorded.notes:
        if note.data.get("event") == UNSTAMPED:
            rest |= set(range(*note.data["samples"]))
    if rest:
        text = f"{len(rest)} samples came without a timestamp: a recorder connected in a "
        text += "chunk under way; theirs are extrapolated from the next chunk, one period each"
        yield Verdict.WARN, text, "exclude the trial they are in, if there is one"
    for text in {str(note.data["text"]) for note in recorded.notes if _is_warning(note.data)}:
        yield Verdict.WARN, text.partition(": ")[0], text.partition(": ")[2] or "correct it"


def _taken(recorded: RecordedStream) -> str:
    told = (note.data["text"] for note in recorded.notes if note.data.get("event") == TAKEN)
    return "; ".join(dict.fromkeys(map(str, told)))


def _is_warning(data: Mapping[str, Any]) -> bool:
    return data.get("event") == "warning" and "text" in data
