"""Corrected times against clocks whose truth is known in closed form."""

from dataclasses import replace

import numpy as np
import pytest
from streams.synthetic import SourceClock, after_one_another, arrivals, probe, source

from labcrane import RecordingError
from labcrane.streams.sync.correction import Treatment, correct
from labcrane.streams.sync.dejitter import Dejitter
from labcrane.streams.sync.offset import fit
from labcrane.streams.sync.quality import Basis
from labcrane.streams.sync.raw import REMOTE, RTT, RawStream

REGULAR = Treatment(rate_hz=500.0, dejitter=Dejitter.NONE)
MARKERS = Treatment()


@pytest.fixture
def random():
    return np.random.default_rng(3)


def regular(duration=120.0, rate=500.0):
    return 100.0 + np.arange(int(duration * rate)) / rate


def irregular(random, duration=120.0):
    return 100.0 + np.sort(random.uniform(0.0, duration, int(3 * duration)))


def p95(corrected, times):
    return float(np.quantile(np.abs(corrected.time - times), 0.95))


@pytest.mark.parametrize("ppm", [-200.0, 0.0, 50.0, 200.0])
def test_a_drifting_clock_is_followed_within_microseconds(random, ppm):
    times = regular()
    corrected = correct(source(SourceClock(ppm=ppm), times, random), REGULAR)
    assert p95(corrected, times) < 3e-6
    assert corrected.quality.drift_ppm == pytest.approx(ppm, abs=0.2)
    assert corrected.quality.rate_hz == pytest.approx(500.0, rel=1e-6)
    assert corrected.quality.gaps == 0


@pytest.mark.parametrize("kind", ["regular", "irregular"])
def test_a_wandering_clock_is_followed(random, kind):
    times = regular(400) if kind == "regular" else irregular(random, 400)
    raw = source(SourceClock(wander_s=0.001), times, random)
    corrected = correct(raw, REGULAR if kind == "regular" else MARKERS)
    assert p95(corrected, times) < 3e-5


@pytest.mark.parametrize("kind", ["regular", "irregular"])
@pytest.mark.parametrize("step", [0.3, -0.3, 40.0])
def test_a_step_of_the_clock_moves_no_sample(random, kind, step):
    times = regular() if kind == "regular" else irregular(random)
    raw = source(SourceClock(step_s=step, step_at=161.234), times, random)
    corrected = correct(raw, REGULAR if kind == "regular" else MARKERS)
    assert np.abs(corrected.time - times).max() < 1e-5
    assert [segment.basis for segment in corrected.segments] == [Basis.PROBES] * 2
    assert corrected.quality.unsure == 0


def test_a_small_step_is_found_between_regular_stamps(random):
    times = regular()
    raw = source(SourceClock(step_s=0.004, step_at=161.234), times, random)
    corrected = correct(raw, REGULAR)
    assert np.abs(corrected.time - times).max() < 1e-5
    assert len(corrected.segments) == 2


def test_a_small_step_of_a_marker_clock_is_owned_up_to(random):
    times = irregular(random)
    raw = source(SourceClock(step_s=0.004, step_at=161.234), times, random)
    corrected = correct(raw, MARKERS)
    wrong = np.abs(corrected.time - times) > 1e-5
    unsure = corrected.segments[1].unsure
    assert 0 < unsure <= 20
    assert np.count_nonzero(wrong) <= unsure
    assert np.abs(corrected.time - times).max() < 0.0041


@pytest.mark.parametrize("kind", ["regular", "irregular"])
@pytest.mark.parametrize("offset", [5000.0, -3.0, 999.9])
def test_a_restarted_source_with_another_clock_moves_no_sample(random, kind, offset):
    times = regular(60) if kind == "regular" else irregular(random, 60)
    later = times + 64.0
    first = source(SourceClock(), times, random)
    second = source(SourceClock(offset=offset, ppm=-50.0), later, random)
    raw = after_one_another(first, second, told=163.5)
    corrected = correct(raw, REGULAR if kind == "regular" else MARKERS)
    assert np.abs(corrected.time - np.r_[times, later]).max() < 1e-5


def test_a_clock_known_for_seconds_only_does_not_borrow_the_rate_of_another(random):
    times, later = regular(6), regular(60) + 10.0
    raw = after_one_another(
        source(SourceClock(ppm=100.0), times, random),
        source(SourceClock(offset=5000.0, ppm=-100.0), later, random),
        told=109.5,
    )
    corrected = correct(raw, REGULAR)
    assert np.abs(corrected.time - np.r_[times, later]).max() < 5e-5


@pytest.mark.parametrize("kind", ["regular", "irregular"])
def test_a_chunk_that_holds_both_sources_is_cut_between_them(random, kind):
    times = regular(60) if kind == "regular" else irregular(random, 60)
    later = times + 64.0
    first = source(SourceClock(), times, random)
    second = source(SourceClock(offset=5000.0), later, random)
    raw = after_one_another(first, second, told=163.5)
    n = len(times)
    resets = np.array([[163.5, n - 20.0, n + 30.0]])
    raw = RawStream(raw.stamps, raw.probes, raw.arrivals, resets)
    corrected = correct(raw, REGULAR if kind == "regular" else MARKERS)
    assert np.abs(corrected.time - np.r_[times, later]).max() < 1e-5


def test_a_marker_program_restarted_on_a_clock_nearly_the_same_is_cut_where_it_was_told(random):
    """Neither its stamps nor their arrival show where the step of 20 ms is."""
    times, later = irregular(random, 60), irregular(random, 60) + 61.0
    first = source(SourceClock(), times, random)
    second = source(SourceClock(offset=1000.02), later, random)
    corrected = correct(after_one_another(first, second, told=160.9), MARKERS)
    assert np.abs(corrected.time - np.r_[times, later]).max() < 1e-5
    assert corrected.quality.unsure == 0


@pytest.mark.parametrize("offset", [-700.0, 9000.0])
def test_a_source_replaced_before_its_first_probe_is_placed_by_arrival(random, offset):
    """Of the first clock nothing is known but when its samples came."""
    times, later = regular(0.8), regular(60) + 4.0
    first = SourceClock(offset=offset)(times)
    second = SourceClock(offset=5000.0)
    raw = RawStream(
        np.r_[first, second(later)],
        probes=probe(second, 104.2, 164.0, random),
        arrivals=arrivals(np.r_[times, later]),
    )
    corrected = correct(raw, REGULAR)
    error = np.abs(corrected.time - np.r_[times, later])
    assert error[: len(times)].max() < 0.03
    assert error[len(times) :].max() < 1e-5
    assert corrected.quality.unprobed == len(times)


def test_samples_that_the_network_held_up_keep_their_time(random):
    times = regular()
    raw = source(SourceClock(), times, random)
    held = raw.arrivals.copy()
    stuck = (held[:, 1] > 140.0) & (held[:, 1] < 175.0)
    held[stuck, 1] = 175.0
    corrected = correct(RawStream(raw.stamps, raw.probes, held), REGULAR)
    assert np.abs(corrected.time - times).max() < 1e-5
    assert len(corrected.segments) == 1


def test_markers_may_tell_of_what_happened_before(random):
    """An event's time is not the time it is sent."""
    times = irregular(random)
    stamped = times - random.uniform(0.0, 5.0, len(times))
    clock = SourceClock()
    raw = RawStream(clock(stamped), probe(clock, 100.3, 221.0, random), arrivals(times))
    assert p95(correct(raw, MARKERS), stamped) < 5e-6


@pytest.mark.parametrize("late_s", [0.4, 2.0, 30.0])
def test_samples_that_a_device_held_back_are_not_moved(random, late_s):
    """With 2 s they were taken for another clock's, and moved by 2 s where 0.1 s were stated."""
    times = regular()
    honest = source(SourceClock(), times, random)
    held = honest.arrivals + np.array([0.0, late_s])
    corrected = correct(RawStream(honest.stamps, honest.probes, held), REGULAR)
    assert corrected.quality.whose == ""
    assert np.abs(corrected.time - times).max() < 1e-5
    assert corrected.quality.error_p95_s == pytest.approx(late_s, rel=0.05)


@pytest.mark.parametrize("foreign", [1.7e9, -40_000.0])
def test_stamps_of_a_clock_that_lsl_does_not_know_are_told(random, foreign):
    """Some programs stamp with the time of day, or with what the device counts."""
    times = regular(60)
    honest = source(SourceClock(ppm=0.0), times, random)
    raw = RawStream(honest.stamps + foreign, honest.probes, honest.arrivals)
    corrected = correct(raw, REGULAR)
    assert corrected.quality.lag_s == pytest.approx(-foreign, rel=1e-5)
    assert corrected.quality.whose == "foreign"
    assert corrected.quality.unprobed == len(times)
    assert (np.abs(corrected.time - times) < corrected.error).all()


def test_delay_of_probes_on_one_way_is_found_by_their_round_trips(random):
    """Of eight exponential delays of 2 ms the shortest is 0.25 ms, and half of it the error."""
    times = regular(300)
    raw = source(SourceClock(), times, random, every=2.0, reply_s=0.002)
    assert p95(correct(raw, REGULAR), times) < 5e-5
    error = raw.probes[:, 0] + raw.probes[:, 1] - our_time(raw.probes[:, 0])
    assert np.mean(np.abs(error)) > 1e-4


def our_time(reading):
    """Return our time when a clock of 1000 s and 100 ppm reads something."""
    return (reading - 1000.0 + 100e-6 * 100.0) / (1 + 100e-6)


def test_a_stray_probe_is_left_out(random):
    times = regular()
    raw = source(SourceClock(), times, random)
    raw.probes[60, 1] += 0.5
    corrected = correct(raw, REGULAR)
    assert len(corrected.segments) == 1
    assert p95(corrected, times) < 3e-6


@pytest.mark.parametrize("kind", ["regular", "irregular"])
def test_a_clock_whose_stamps_go_on_evenly_was_turned_and_did_not_step(random, kind):
    """Two probes alone tell nothing of how it came from one offset to the next."""
    times = regular() if kind == "regular" else irregular(random)
    clock = SourceClock()
    raw = source(lambda t: clock(t) + 0.01 * np.clip(t - 160.0, 0.0, 2.0), times, random)
    turned = (raw.probes[:, 3] > 159.0) & (raw.probes[:, 3] < 163.5)
    corrected = correct(
        RawStream(raw.stamps, raw.probes[~turned], raw.arrivals),
        REGULAR if kind == "regular" else MARKERS,
    )
    assert corrected.quality.steps == (0 if kind == "regular" else 1)
    assert np.mean(np.abs(corrected.time - times) <= corrected.error) >= 0.95


def test_a_curve_that_no_ways_of_its_probes_allow_says_so(random):
    """A probe bounds the offset by half its round trip, whatever is thought of the clock."""
    probes = source(SourceClock(), regular(), random).probes
    curve = fit(probes, 0.0)
    moved = replace(curve, smoothed=replace(curve.smoothed, offset=curve.smoothed.offset + 2e-3))
    least = 2e-3 - np.abs(curve.residuals) - probes[:, RTT] / 2.0
    assert (moved.with_error(probes[:, REMOTE])[1] >= least).all()


def test_a_clock_that_was_probed_once_is_placed_by_that_probe(random):
    times = regular(2.0)
    raw = source(SourceClock(), times, random)
    corrected = correct(RawStream(raw.stamps, raw.probes[:1], raw.arrivals), REGULAR)
    assert np.abs(corrected.time - times).max() < 5e-4
    assert (np.abs(corrected.time - times) <= corrected.error).all()
    assert corrected.quality.slews == 0


def test_a_long_time_without_probes_is_no_step(random):
    times = regular(600)
    raw = source(SourceClock(ppm=150.0), times, random)
    away = (raw.probes[:, 3] > 200.0) & (raw.probes[:, 3] < 500.0)
    corrected = correct(RawStream(raw.stamps, raw.probes[~away], raw.arrivals), REGULAR)
    assert len(corrected.segments) == 1
    assert p95(corrected, times) < 5e-5
    assert corrected.quality.probe_age_s == pytest.approx(150.0, abs=2.0)


def test_latency_is_subtracted_last(random):
    times = regular(30)
    raw = source(SourceClock(), times, random)
    plain, late = (correct(raw, Treatment(500.0, latency_s=latency)) for latency in (0.0, 0.0516))
    np.testing.assert_allclose(plain.time - late.time, 0.0516, atol=1e-9)


def test_a_transport_delay_needs_the_envelope():
    with pytest.raises(RecordingError, match="envelope"):
        correct(RawStream(np.arange(9.0)), Treatment(rate_hz=500.0, transport_s=0.008))


def test_correction_alters_nothing_and_can_be_repeated(random):
    raw = source(SourceClock(wander_s=0.001), regular(30), random)
    before = raw.stamps.copy(), raw.probes.copy(), raw.arrivals.copy()
    first, second = correct(raw, Treatment(500.0)), correct(raw, Treatment(500.0))
    np.testing.assert_array_equal(first.time, second.time)
    for was, now in zip(before, (raw.stamps, raw.probes, raw.arrivals), strict=True):
        np.testing.assert_array_equal(was, now)


def test_a_stream_without_samples_or_probes_breaks_nothing():
    assert len(correct(RawStream(np.empty(0)), REGULAR).time) == 0
    unknown = correct(RawStream(np.arange(100.0)), REGULAR)
    assert np.isnan(unknown.time).all()
    assert unknown.segments[0].basis is Basis.NOTHING
    assert unknown.quality.unprobed == 100
