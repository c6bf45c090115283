"""What is said of time stamps, and of a recording that was not what it should have been."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from streams.synthetic import SourceClock, source

from labcrane import RecordingError
from labcrane.core import Verdict
from labcrane.recording import Channel, StreamHeader
from labcrane.recording.foreign_streams import Note, RecordedStream
from labcrane.streams.sync.correction import Treatment, correct
from labcrane.streams.sync.quality import Quality
from labcrane.streams.sync.raw import LOCAL, RawStream
from labcrane.streams.sync.report.certificate import Fault
from labcrane.streams.sync.report.limits import Limits, WarnLimit
from labcrane.streams.sync.report.stream_report import judge_stream
from labcrane.streams.sync.report.sync_report import COLUMNS, SyncReport, judge_loop, never_came
from labcrane.streams.sync.resync import columns_of, quality_of, resync, treatment_of

EEG = StreamHeader("EEG", "EEG", (Channel("Cz", "microvolts"),), rate_hz=500.0, source_id="amp-1")


def recorded(header=EEG, clock=None, times=None, notes=()):
    times = 100.0 + np.arange(30_000) / 500.0 if times is None else times
    raw = source(clock or SourceClock(), times, np.random.default_rng(3))
    return RecordedStream(
        header=header,
        time_raw=raw.stamps,
        data=np.zeros((len(times), 1)),
        texts=[],
        probes=raw.probes,
        arrivals=raw.arrivals,
        notes=(Note(100.0, {"event": "opened"}), *notes),
        offsets=raw.probes[:, :2],
    )


def judged(stream):
    return judge_stream(stream, resync(stream).quality, Limits())


def test_a_stream_in_order_passes():
    report = judged(recorded(clock=SourceClock(ppm=40.0)))
    assert (report.verdict, report.findings, report.samples) == (Verdict.PASS, (), 30_000)


def test_samples_whose_stamps_are_worked_back_are_counted_once_and_told():
    notes = [Note(100.0, {"event": "unstamped", "samples": part}) for part in ([0, 8], [3, 8])]
    findings = judged(recorded(notes=notes)).findings
    (found,) = (each for each in findings if "without a timestamp" in each.text)
    assert found.verdict is Verdict.WARN
    assert found.text.startswith("8 samples came without a timestamp: a recorder connected in a")
    assert found.advice == "exclude the trial they are in, if there is one"


@pytest.mark.parametrize("seed", range(6))
def test_a_buffer_that_shrinks_is_told(seed: int) -> None:
    draw = np.random.default_rng(seed)
    times = 100.0 + np.arange(30_000) / 500.0
    times[: int(draw.integers(5_000, 25_000))] += draw.uniform(0.02, 0.045)
    raw = source(SourceClock(), np.maximum.accumulate(times), draw)
    stream = replace(recorded(), time_raw=SourceClock()(times), arrivals=raw.arrivals)
    (found,) = (each for each in judged(stream).findings if "timestamps shifted" in each.text)
    assert found.verdict is Verdict.WARN
    assert "its delay changed" in found.text
    corrected = resync(stream)
    assert np.array_equal(corrected.time, corrected.uneven)


@pytest.mark.parametrize(
    ("change", "verdict", "text"),
    [
        ({"drift_ppm": -180.0}, Verdict.WARN, "runs -180 ppm off"),
        ({"drift_ppm": 800.0}, Verdict.FAIL, "runs +800 ppm off"),
        ({"residual_s": 0.001}, Verdict.WARN, "scatters by 1.000 ms"),
        ({"rtt_p95_s": 0.008}, Verdict.WARN, "4.00 ms may be hidden"),
        ({"probe_age_s": 50.0}, Verdict.FAIL, "up to 50 s without a clock probe"),
        ({"rate_hz": 400.0}, Verdict.FAIL, "400.00 Hz instead of 500 Hz"),
        ({"rate_hz": math.nan}, Verdict.FAIL, "samples do not show at which rate it samples"),
        ({"gaps": 2, "longest_gap_s": 0.4}, Verdict.WARN, "2 gaps, the longest 0.400 s"),
        ({"lag_s": -1.7e9}, Verdict.FAIL, "its timestamps are -1700000000.000 s before"),
        ({"dropped": 3}, Verdict.WARN, "3 samples are missing"),
        ({"backward": 8}, Verdict.WARN, "8 samples are placed before one that arrived earlier"),
        ({"grid_s": 1e-3}, Verdict.WARN, "its timestamps are cut to 1 ms"),
        ({"grid_s": 1 / 64}, Verdict.WARN, "its timestamps are cut to 15.625 ms"),
        ({"silent_s": 9.0}, Verdict.FAIL, "it died: no sample came in the last 9 s"),
        ({"unsure": 12}, Verdict.WARN, "12 samples are near a step"),
        ({"unprobed": 7}, Verdict.FAIL, "7 samples are from a clock that was never probed"),
        ({"rtt_p50_s": math.nan}, Verdict.FAIL, "never probed"),
    ],
)
def test_each_shortcoming_is_named_with_what_to_do(change, verdict, text):
    stream = recorded(clock=SourceClock(ppm=40.0))
    report = judge_stream(stream, replace(resync(stream).quality, **change), Limits())
    assert report.verdict is verdict
    (finding,) = report.findings
    assert text in finding.text
    assert len(finding.advice) > 10


def test_an_irregular_stream_died_when_its_program_answers_no_more() -> None:
    """One whose program goes on is silent, which says nothing."""
    random = np.random.default_rng(5)
    times = 100.0 + np.sort(random.uniform(0.0, 120.0, 300))
    raw = source(SourceClock(ppm=40.0), times, random)
    own = raw.probes[raw.probes[:, LOCAL] < 160.0]
    early = int(np.searchsorted(times, 158.0))
    stamps, arrivals = raw.stamps[:early], raw.arrivals[raw.arrivals[:, 0] <= early]
    dead, alive = (RawStream(stamps, probes, arrivals) for probes in (own, raw.probes))
    beside = replace(alive, own_probes=own)  # another program of its computer answers
    silent = [correct(one, Treatment(), 220.0).quality.silent_s for one in (dead, beside, alive)]
    assert 40.0 < silent[0] < 62.0
    assert 40.0 < silent[1] < 62.0
    assert silent[2] < 5.0
    header = StreamHeader("Marks", "Markers", (Channel("mark", ""),), rate_hz=0.0, source_id="m-1")
    quality = correct(dead, Treatment(), 220.0).quality
    report = judge_stream(replace(recorded(), header=header), quality, Limits())
    assert Fault.DIED in report.faults
    assert any("no sample came and no probe was answered" in one.text for one in report.findings)


def test_samples_that_a_sources_counter_left_out_are_judged():
    gaps = [(101.0, 2), (103.0, 400)]
    notes = [Note(t, {"event": "counter gap", "missing": n, "samples": [0, 9]}) for t, n in gaps]
    report = judged(recorded(clock=SourceClock(ppm=40.0), notes=notes))
    (finding,) = report.findings
    assert (finding.verdict, report.quality.dropped) == (Verdict.FAIL, 402)
    assert finding.text == "402 samples are missing, by its counter or by its timestamps"


def test_what_is_not_known_fails():
    assert WarnLimit(1.0, 2.0).judge(math.nan) is Verdict.FAIL
    assert WarnLimit(1.0, 2.0).judge(1.0) is Verdict.PASS
    assert WarnLimit(1.0, 2.0).judge(2.0) is Verdict.WARN


@pytest.mark.parametrize(("required", "verdict"), [(True, Verdict.FAIL), (False, Verdict.WARN)])
def test_a_stream_without_samples_is_named_and_breaks_nothing(required, verdict):
    empty = replace(recorded(), time_raw=np.empty(0), arrivals=np.empty((0, 2)))
    report = judge_stream(empty, resync(empty).quality, Limits(), required=required)
    assert report.verdict is verdict
    assert "no sample came" in report.findings[0].text
    assert "TCP" in report.findings[0].advice
    own = replace(empty, header=replace(empty.header, name="labcrane.estimate.load"))
    (finding,) = judge_stream(own, resync(own).quality, Limits(), required=required).findings
    assert "estimate.failed" in finding.advice
    assert "TCP" not in finding.advice


def test_restarts_and_warnings_of_the_recorder_are_told():
    notes = (
        Note(120.0, {"event": "reset", "samples": [10_000, 10_000]}),
        Note(121.0, {"event": "warning", "text": "has no source_id: set one"}),
    )
    report = judged(recorded(clock=SourceClock(ppm=1.0), notes=notes))
    assert [finding.text for finding in report.findings] == [
        "its program was restarted 1 times",
        "has no source_id",
    ]


def test_a_reset_in_a_later_part_is_found_there():
    times, later = 100.0 + np.arange(10_000) / 500.0, 130.0 + np.arange(20_000) / 500.0
    first = recorded(times=times)
    second = recorded(clock=SourceClock(offset=5000.0), times=later)
    stream = replace(
        first,
        time_raw=np.r_[first.time_raw, second.time_raw],
        probes=np.r_[first.probes, second.probes],
        arrivals=np.r_[first.arrivals, second.arrivals + np.array([10_000, 0.0])],
        notes=(
            *first.notes,
            *second.notes,
            Note(129.0, {"event": "reset", "samples": [10_000, 10_000]}),
        ),
        starts=(0, 10_000),
    )
    corrected = resync(stream)
    assert [segment.start for segment in corrected.segments] == [0, 10_000]
    assert np.abs(corrected.time - np.r_[times, later]).max() < 1e-5


def test_the_file_gets_a_row_per_sample_and_flat_figures():
    stream = recorded()
    corrected = resync(stream)
    columns = columns_of(corrected)
    assert list(columns) == ["time", "time_error", "time_uneven", "time_basis"]
    assert {len(column) for column in columns.values()} == {30_000}
    quality = quality_of(corrected, treatment_of(stream.header))
    assert quality["drift_ppm"] == pytest.approx(100.0, abs=0.5)
    assert quality["dejitter"] == "auto"
    assert all(isinstance(value, float | str) for value in quality.values())


def test_a_streams_own_header_says_how_it_is_read():
    timing = {"synchronization": {"can_drop_samples": "true", "offset_mean": "0.0516"}}
    treatment = treatment_of(replace(EEG, desc=timing))
    assert treatment.can_drop_samples
    assert treatment.latency_s == 0.0516
    with pytest.raises(RecordingError, match="'soon', which is not a number"):
        treatment_of(replace(EEG, desc={"synchronization": {"offset_mean": "soon"}}))


def test_late_ticks_and_missing_ones_are_judged():
    due = np.arange(1000) / 240.0
    woke = due + 0.0001
    assert judge_loop(due, woke, 240.0, Limits()).verdict is Verdict.PASS
    woke[:20] += 0.005
    loop = judge_loop(due, woke, 240.0, Limits())
    assert (loop.verdict, loop.late) == (Verdict.WARN, 20)
    assert loop.lateness_max_s == pytest.approx(0.0051)
    assert judge_loop(due, woke, 240.0, Limits(), dropped=1).verdict is Verdict.FAIL


def test_the_report_is_a_table_advice_and_json():
    bad = judge_stream(recorded(), Quality(), Limits())
    good = judged(recorded(clock=SourceClock(ppm=40.0)))
    due = np.arange(10) / 240.0
    report = SyncReport(
        (good, bad), judge_loop(due, due, 240.0, Limits()), never_came({"Gaze": True})
    )
    assert report.verdict is Verdict.FAIL
    assert [len(row) for row in report.table()] == [len(COLUMNS)] * 2
    assert report.table()[0][:4] == ("EEG", "PASS", "30000", "500.00")
    assert report.advice()[0].startswith("FAIL Gaze was never on the network; start its program")
    content = json.loads(json.dumps(report.as_json(), allow_nan=False))
    assert content["verdict"] == "FAIL"
    assert content["streams"][1]["quality"]["drift_ppm"] is None
    assert SyncReport(()).verdict is Verdict.PASS
