"""Stamps made even, and where they must not be."""

import numpy as np
import pytest
from streams.synthetic import SourceClock, source

from labcrane.streams.sync.correction import Treatment, correct
from labcrane.streams.sync.dejitter import Dejitter, even, left_open
from labcrane.streams.sync.raw import RawStream
from labcrane.streams.sync.stamping.late_chunks import lost_before, lost_between


@pytest.fixture
def random():
    return np.random.default_rng(3)


def regular(duration=120.0, rate=500.0):
    return 100.0 + np.arange(int(duration * rate)) / rate


def p95(corrected, times):
    return float(np.quantile(np.abs(corrected.time - times), 0.95))


def chunks(times, random, size=20, least=0.008, scatter=0.004):
    """Return when each sample is stamped by a driver that stamps chunks when it sends them."""
    last = times.reshape(-1, size)[:, -1]
    sent = last + least + random.exponential(scatter, len(last))
    behind = (np.arange(size) - (size - 1)) / 500.0
    return (sent[:, None] + behind).ravel()


@pytest.mark.parametrize(
    ("treatment", "limit"),
    [
        (Treatment(rate_hz=500.0, latency_s=0.012), 2.5e-4),
        (Treatment(rate_hz=500.0, dejitter=Dejitter.ENVELOPE, transport_s=0.008), 5e-5),
    ],
)
def test_stamps_made_when_chunks_are_sent_are_evened(random, treatment, limit):
    times = regular(300)
    raw = source(SourceClock(), times, random, stamped=chunks(times, random))
    assert p95(correct(raw, treatment), times) < limit


def test_the_envelope_does_not_see_a_busy_computer(random):
    times = regular(300)
    stamped = chunks(times, random)
    busy = np.repeat(random.exponential(0.004, len(times) // 20), 20) * (times > 250.0)
    raw = source(SourceClock(), times, random, stamped=stamped + busy)
    envelope = Treatment(rate_hz=500.0, dejitter=Dejitter.ENVELOPE, transport_s=0.008)
    assert p95(correct(raw, envelope), times) < 1e-4


def test_a_crystal_that_wanders_with_the_temperature_is_followed(random):
    """A fifth of a millisecond in ten minutes, two parts in a million: one line would miss it."""
    even = 100.0 + np.arange(90_000) / 100.0
    times = even + 0.0002 * np.sin(2 * np.pi * even / 600.0)
    corrected = correct(source(SourceClock(), times, random), Treatment(rate_hz=100.0))
    assert np.abs(corrected.time - times).max() < 6e-5


@pytest.mark.parametrize("treatment", [Treatment(), Treatment(rate_hz=500, can_drop_samples=True)])
def test_markers_and_cameras_are_never_evened(random, treatment):
    times = regular(60) + random.uniform(-0.0005, 0.0005, 30000)
    corrected = correct(source(SourceClock(ppm=0.0), times, random), treatment)
    assert np.abs(corrected.time - times).max() < 1e-5


def test_missing_samples_are_not_evened_away(random):
    times = np.delete(regular(60), slice(15000, 15400))
    corrected = correct(source(SourceClock(), times, random), Treatment(rate_hz=500.0))
    assert np.abs(corrected.time - times).max() < 1e-5
    assert corrected.quality.gaps == 1
    assert corrected.quality.longest_gap_s == pytest.approx(0.802, abs=1e-4)


def test_a_counter_bridges_missing_samples(random):
    whole = regular(60)
    kept = np.delete(np.arange(len(whole)), slice(15000, 15010))
    times = whole[kept]
    stamped = chunks(whole, random)[kept]
    raw = source(SourceClock(), times, random, stamped=stamped)
    raw = RawStream(raw.stamps, raw.probes, raw.arrivals, index=kept.astype(float))
    corrected = correct(raw, Treatment(500.0, dejitter=Dejitter.ENVELOPE, transport_s=0.008))
    assert p95(corrected, times) < 1e-4
    assert corrected.quality.dropped == 10


@pytest.mark.parametrize("seed", range(5))
def test_chunks_that_a_busy_computer_holds_up_have_lost_nothing_and_lost_ones_are_counted(seed):
    random = np.random.default_rng(seed)
    index = 25.0 * np.arange(600)
    rest = random.exponential(0.003, 600)
    for begin in (0, 280, 520):  # at first, in the middle, at last
        rest[begin : begin + 70] += random.exponential(0.05, 70)
    assert lost_between(index, rest, 0.004)[0] is False
    at = np.sort(random.choice(np.arange(40, 500), 12, replace=False))
    lost = np.searchsorted(at, np.arange(600), side="right") * 3.0
    assert lost_between(index, rest + 0.004 * lost, 0.004)[0] is True
    found = lost_before(rest + 0.004 * lost, 0.004)
    assert abs(found[-1] - 36.0) <= 1.0  # the first ones may go while all chunks are held up
    assert np.mean(np.abs(found - lost) <= 1.0) > 0.8


def test_lines_that_swallowed_lost_samples_are_said_to_be_off(random):
    index = np.arange(30_000.0)
    lost = np.repeat([0.0, 5.0, 9.0, 20.0], 7500)
    true = 100.0 + (index + lost) / 250.0
    late = np.repeat(0.005 + random.exponential(0.003, 1200), 25)
    evened = even(true + late, index, Dejitter.ENVELOPE) - 0.005
    off = np.abs(evened - true)
    assert off.max() > 0.02
    assert np.mean(off <= left_open(true + late, evened, Dejitter.ENVELOPE) + 0.005) > 0.99


@pytest.mark.parametrize("way", [Dejitter.LEAST_SQUARES, Dejitter.ENVELOPE])
@pytest.mark.parametrize("silent_s", [0.0, 3600.0])
def test_slow_streams_and_long_silences_are_evened_where_that_is_asked_for(
    random, way: Dejitter, silent_s: float
) -> None:
    """A thermometer has fewer samples than seconds; so has any stream that was silent for long."""
    times = regular(200.0, 0.5)
    times[50:] += silent_s
    late = random.exponential(0.002, len(times))
    stamped = times + (late if way is Dejitter.ENVELOPE else late - np.median(late))
    raw = source(SourceClock(), times, random, stamped=stamped)
    corrected = correct(raw, Treatment(rate_hz=0.5, dejitter=way))
    off = np.abs(corrected.time - times)
    assert np.mean(off <= corrected.error) > 0.95
    assert off.max() < 0.003
