"""The recorder's own clock is logged, and where it was slewed other clocks are followed past it."""

from pathlib import Path

import h5py
import numpy as np
import pytest
from needs import needs
from streams.synthetic import SourceClock, arrivals, probe
from streams.unkinder import own_slewed

from labcrane.clocks import correct as correct_arrays
from labcrane.errors import RecordingError
from labcrane.recording.foreign_streams import OWN_CLOCK, both_clocks, read_streams
from labcrane.recording.participant_file.recorrect import read_stream
from labcrane.recording.participant_file.stream_group import write_streams
from labcrane.recording.xdf.header import Channel, StreamHeader
from labcrane.recording.xdf.writer import XdfWriter
from labcrane.streams.probes import Probe
from labcrane.streams.recorder.companions import RecordedStreamWriter
from labcrane.streams.recorder.own_clock import read_own_clock
from labcrane.streams.recorder.recorder import Recorder
from labcrane.streams.sync.correction import Treatment, correct
from labcrane.streams.sync.own_clock import OwnClock
from labcrane.streams.sync.raw import RawStream, raw_of
from labcrane.streams.sync.report.certificate import Fault, faults

linux = needs("Linux")

RATE, SLEW, BEGIN, END = 250.0, 500e-6, 160.0, 220.0


def ours(t):
    """Return our clock's reading: turned by 500 ppm for a minute."""
    return t + SLEW * (np.clip(t, BEGIN, END) - BEGIN)


@pytest.fixture
def received():
    """Return a stream received by a clock that was slewed, its log, and its true times."""
    random = np.random.default_rng(8)
    times = 100.0 + np.arange(int(240 * RATE)) / RATE
    clock = SourceClock(ppm=30.0)
    shown = probe(clock, 100.3, 340.0, random)
    middle = shown[:, 0] + shown[:, 1]
    shown[:, 1] = ours(middle) - shown[:, 0]
    shown[:, 3] = ours(shown[:, 3])
    came = arrivals(times)
    came[:, 1] = ours(came[:, 1])
    read = np.arange(99.0, 342.0, 0.25) + random.uniform(0.0, 0.05, 972)
    return RawStream(clock(times), shown, came), np.column_stack([ours(read), read]), ours(times)


def test_a_slew_of_our_own_clock_leaves_no_error(received):
    raw, log, truth = received
    found = correct_arrays(
        raw.stamps, probes=raw.probes[:, :3], arrivals=raw.arrival(), rate_hz=RATE, own_clock=log
    )
    error = 1e3 * np.abs(found.time - truth)
    assert np.quantile(error, 0.95) < 0.02
    assert error.max() < 0.1
    assert (error <= 1e3 * found.error).all()
    assert found.quality.own_slews == 2  # its begin and its end
    assert found.quality.slews == 0
    assert Fault.SLEWED in faults(found.quality, RATE)


@pytest.mark.parametrize("seed", range(6))
def test_what_is_logged_is_as_right_as_it_is_said_to_be(seed):
    drawn = own_slewed(np.random.default_rng([seed, 77]), logged=True)
    found = correct(drawn.raw, drawn.treatment)
    error = np.abs(found.time - drawn.truth)
    assert np.mean(error <= found.error) >= 0.95
    assert np.quantile(error, 0.95) <= 1e-4


def test_a_clock_that_was_not_turned_changes_nothing(received):
    raw, log, _ = received
    steady = np.column_stack([log[:, 1], log[:, 1] * (1.0 - 2e-5) + 7e4])
    plain = correct(raw, Treatment(RATE))
    beside = correct(RawStream(raw.stamps, raw.probes, raw.arrivals, own=steady), Treatment(RATE))
    np.testing.assert_array_equal(beside.time, plain.time)


def test_streams_of_this_computer_keep_its_clock(received):
    """Their stamps were turned with it."""
    _, log, truth = received
    random = np.random.default_rng(9)
    shown = probe(np.asarray, 100.3, 340.0, random)
    raw = RawStream(truth, shown, own=log)
    assert OwnClock.of(raw) is None
    assert np.abs(correct(raw, Treatment(RATE)).time - truth).max() < 1e-4


def test_between_readings_a_knee_is_uncertain_and_no_more_than_that(received):
    raw, log, _ = received
    clock = OwnClock.of(RawStream(raw.stamps, raw.probes, raw.arrivals, own=log))
    at = np.linspace(100.0, 340.0, 5001)
    straight = clock.straight(ours(at))
    assert np.abs(straight - straight[0] - (at - at[0])).max() < 1e-4
    np.testing.assert_allclose(clock.ours(straight), ours(at), atol=1e-9)
    assert clock.doubt(ours(at)).max() <= SLEW * 0.3 / 4.0 + 1e-9
    assert np.median(clock.doubt(ours(at))) < 1e-6


@pytest.mark.parametrize("wrong", [np.zeros(5), np.zeros((5, 3)), [[1.0, np.nan]]])
def test_a_log_that_does_not_fit_is_refused(wrong):
    with pytest.raises(
        RecordingError, match=r"own_clock must be finite numbers of the shape \(n, 2\)"
    ):
        correct_arrays(np.arange(3.0), own_clock=wrong)


def test_a_journal_and_a_file_keep_the_log(tmp_path: Path, received):
    raw, log, truth = received
    header = StreamHeader("EEG", "EEG", (Channel("Cz"),), rate_hz=RATE, source_id="amp")
    with XdfWriter(tmp_path / "streams.xdf") as writer:
        own = writer.add_stream(OWN_CLOCK)
        for now, straight in log:
            writer.write_sample(own, now, np.array([now, straight, 500.0, 1e4, 0.0]))
        stream = RecordedStreamWriter(writer, header)
        stream.samples(raw.stamps, np.zeros((len(raw.stamps), 1)))
        for row in raw.probes:
            stream.probe(Probe(*row))
        for count, when in raw.arrivals:
            stream.arrival(int(count), when)
    (recorded,), _ = read_streams([tmp_path / "streams.xdf"])
    with h5py.File(tmp_path / "session.h5", "w") as file:
        group = file.create_group("ses-01")
        write_streams(group, [recorded])
        np.testing.assert_array_equal(group["own_clock/raw"][:], log[:, 1])
        again = read_stream(group["streams/EEG"])
    np.testing.assert_array_equal(again.own_clock, recorded.own_clock)
    assert np.abs(correct(raw_of(again), Treatment(RATE)).time - truth).max() < 1e-4


def test_two_recorders_of_one_computer_log_one_clock():
    one = np.column_stack([np.arange(0.0, 9.0), *np.zeros((4, 9))])
    other = one[4:] + 2.5
    one[:, 1] = one[:, 0]
    other[:, 1] = other[:, 0]
    both = both_clocks(one, other)
    np.testing.assert_array_equal(both[:, 0], np.sort(np.r_[one[:, 0], other[:, 0]]))
    booted = other.copy()
    booted[:, 0] += 5000.0
    np.testing.assert_array_equal(both_clocks(one, booted), one)


@linux
def test_the_system_tells_both_clocks_and_what_turns_one():
    first, second = read_own_clock(), read_own_clock()
    assert first is not None
    assert second is not None
    assert second.time > first.time
    assert second.raw > first.raw
    assert 9_000 <= first.tick_us <= 11_000  # the kernel takes no other
    assert abs(first.frequency_ppm) <= 500.0


@linux
def test_a_recorder_logs_its_own_clock(tmp_path: Path):
    recorder = Recorder(tmp_path / "streams.xdf", [])
    for _ in range(5):
        recorder.look()
    recorder.close()
    from labcrane.recording.xdf.reader import read_xdf

    (stream,) = read_xdf(tmp_path / "streams.xdf").streams
    assert stream.header.type == OWN_CLOCK.type
    assert stream.data.shape == (5, 5)
    np.testing.assert_array_equal(stream.stamps, stream.data[:, 0])
    assert (np.diff(stream.data[:, 1]) > 0.0).all()
