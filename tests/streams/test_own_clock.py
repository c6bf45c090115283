"""The recorder's own clock is logged beside one that nothing turns."""

from pathlib import Path

import h5py
import numpy as np
from needs import needs
from streams.synthetic import SourceClock, probe

from labcrane.clocks import correct
from labcrane.recording import Channel, StreamHeader, XdfWriter
from labcrane.recording.foreign_streams import OWN_CLOCK, both_clocks, read_streams
from labcrane.recording.participant_file.recorrect import read_stream
from labcrane.recording.participant_file.stream_group import write_streams
from labcrane.streams.recorder.companions import RecordedStreamWriter
from labcrane.streams.recorder.own_clock import read_own_clock
from labcrane.streams.recorder.recorder import Recorder
from labcrane.streams.sync.report.certificate import Fault, faults

linux = needs("Linux")


def test_a_slew_of_our_own_clock_shows_in_probes_and_is_stated():
    random = np.random.default_rng(8)
    clock, times = SourceClock(ppm=30.0), 100.0 + np.arange(60_000) / 250.0

    def ours(t):
        return t + 500e-6 * (np.clip(t, 160.0, 220.0) - 160.0)

    shown = probe(clock, 100.3, 340.0, random)
    shown[:, 1] = ours(shown[:, 0] + shown[:, 1]) - shown[:, 0]
    found = correct(clock(times), probes=shown[:, :3], rate_hz=250.0)
    off = np.abs(found.time - ours(times))
    assert np.quantile(off, 0.95) < 5e-5
    assert np.mean(off <= found.error) >= 0.95
    assert Fault.SLEWED in faults(found.quality, 250.0)


def test_a_journal_and_a_file_keep_the_log(tmp_path: Path):
    header = StreamHeader("EEG", "EEG", (Channel("Cz"),), rate_hz=250.0, source_id="amp")
    log = 99.0 + np.arange(0.0, 20.0, 0.25)[:, None] * [1.0, 1.0 + 2e-5]
    with XdfWriter(tmp_path / "streams.xdf") as writer:
        own = writer.add_stream(OWN_CLOCK)
        for now, straight in log:
            writer.write_sample(own, now, np.array([now, straight, 500.0, 1e4, 0.0]))
        stream = RecordedStreamWriter(writer, header)
        stream.samples(100.0 + np.arange(1000) / 250.0, np.zeros((1000, 1)))
    (recorded,), _ = read_streams([tmp_path / "streams.xdf"])
    with h5py.File(tmp_path / "session.h5", "w") as file:
        group = file.create_group("ses-01")
        write_streams(group, [recorded])
        np.testing.assert_array_equal(group["own_clock/raw"][:], log[:, 1])
        again = read_stream(group["streams/EEG"])
    np.testing.assert_array_equal(again.own_clock, recorded.own_clock)


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
