"""Signals are watched in a process of their own: what is found, and what a bad monitor can do."""

import time
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
import pytest

from labcrane import FloatArray, SignalMonitor
from labcrane.cli.streams import watched_lines
from labcrane.core import SignalChannel, SignalFault, SignalStream
from labcrane.monitoring.monitored_stream import MonitoredStream
from labcrane.monitoring.stream_meter import StreamMeter, StreamReading
from labcrane.monitoring.watch import StreamView
from labcrane.recording import Channel, StreamHeader
from labcrane.recording.foreign_streams import MONITORS, SIGNAL, Note
from labcrane.recording.participant_file.signal_faults import write_signal_faults
from labcrane.streams.probes import Probe
from labcrane.streams.recorder import signal_feed
from labcrane.streams.recorder.signal_feed import LIVES, SignalFeed, SignalTap

STREAM = SignalStream("Sensor", "Odd", 100.0, (SignalChannel("a"), SignalChannel("b")))
HEADER = StreamHeader("Sensor", "Odd", (Channel("a"), Channel("b")), rate_hz=100.0)
CALM = np.zeros((10, 2))

PLUGIN = """
import os, time
from labcrane import Settings, SignalMonitor, hookimpl, offer
from labcrane.core import SignalFault

labcrane_api = 1

class Odd(SignalMonitor):
    def knows(self, stream):
        return stream.type == "Odd"
    def begin(self, stream):
        pass
    def look(self, times, samples):
        if samples[-1, 0] == 1.0:
            raise RuntimeError("one is too much")
        if samples[-1, 0] == 2.0:
            os._exit(7)
        if samples[-1, 0] == 3.0:
            time.sleep(600.0)
        return [SignalFault("b", "odd", "look at it")] if samples[-1, 1] else []

class OddSettings(Settings):
    "None."

@hookimpl
def labcrane_monitors():
    return [offer("odd", OddSettings, lambda settings, machine: Odd())]
"""


class Scripted(SignalMonitor):
    """Finds what it is told to, or raises it."""

    def __init__(self, *found: Sequence[SignalFault] | Exception) -> None:
        self.found = list(found)

    def knows(self, stream: SignalStream) -> bool:
        return True

    def begin(self, stream: SignalStream) -> None:
        pass

    def look(self, times: FloatArray, samples: FloatArray) -> Sequence[SignalFault]:
        found = self.found.pop(0)
        if isinstance(found, Exception):
            raise found
        return found


def test_a_fault_is_a_change_when_it_comes_and_when_it_goes() -> None:
    fault = SignalFault("a", "flat line", "look")
    stream = MonitoredStream(STREAM, {"one": Scripted([], [fault], [fault], [])})
    changes = [stream.look(np.empty(0), CALM) for _ in range(4)]
    assert [[(each.fault, each.bad) for each in now] for now in changes] == [
        [],
        [(fault, True)],
        [],
        [(fault, False)],
    ]
    assert stream.faults == ()


def test_a_monitor_that_raises_is_left_out_and_the_others_go_on() -> None:
    fault = SignalFault("a", "flat line", "look")
    bad, good = Scripted([fault], ZeroDivisionError("by a plugin")), Scripted([], [fault], [])
    stream = MonitoredStream(STREAM, {"bad": bad, "good": good})
    for _ in range(2):
        stream.look(np.empty(0), CALM)
    assert stream.failed == {"bad": "ZeroDivisionError: by a plugin"}
    assert stream.faults == (fault,)
    stream.look(np.empty(0), CALM)
    assert stream.faults == ()
    assert stream.watched


class Noted:
    """A tap whose notes are kept."""

    def __init__(self, folder: Path, hang_s: float = 20.0) -> None:
        (folder / "plugins").mkdir()
        (folder / "plugins" / "odd.py").write_text(PLUGIN, encoding="utf-8")
        config = {"protocol": str(folder / "study.yaml"), "use": [{"use": "odd"}]}
        self.feed = SignalFeed(config, hang_s)
        self.notes: list[dict[str, object]] = []
        self.tap = SignalTap(self.feed, self.note)
        self.tap.begin(HEADER)
        self.first = 0

    def note(self, event: str, **data: object) -> None:
        if event == SIGNAL:
            self.notes.append(data)
        else:
            assert (event, data) == (MONITORS, {"names": ["odd"]})

    def give(self, a: float, b: float = 0.0) -> None:
        samples = np.column_stack([np.full(10, a), np.full(10, b)])
        self.tap.give(np.arange(10.0), samples, self.first)
        self.first += 10

    def until(self, done: object) -> None:
        ends = time.monotonic() + 240.0
        while not done():
            assert time.monotonic() < ends, (self.notes, self.feed.fault, self.tap.failed)
            self.feed.look()
            time.sleep(0.02)


def test_what_the_process_finds_is_noted_with_the_samples_in_which_it_was(tmp_path: Path) -> None:
    noted = Noted(tmp_path)
    for b in (0.0, 0.0, 5.0, 5.0, 0.0):
        noted.give(0.0, b)
    noted.until(lambda: len(noted.notes) == 2)
    noted.feed.close()
    what = {"channel": "b", "kind": "odd", "message": "look at it"}
    assert noted.notes == [
        {**what, "bad": True, "samples": [20, 30]},
        {**what, "bad": False, "samples": [40, 50]},
    ]
    assert noted.feed.fault is None


def test_a_monitor_that_raises_in_its_process_is_told_by_its_name(tmp_path: Path) -> None:
    noted = Noted(tmp_path)
    noted.give(1.0)
    noted.until(lambda: noted.tap.failed)
    noted.feed.close()
    assert noted.tap.failed == {"odd": "RuntimeError: one is too much"}


@pytest.mark.slow
@pytest.mark.parametrize("how", [2.0, 3.0], ids=["crashes", "hangs"])
def test_a_monitor_takes_its_process_with_it_and_another_one_goes_on(
    how: float, tmp_path: Path
) -> None:
    noted = Noted(tmp_path, hang_s=240.0)  # a busy computer is no hang
    noted.give(0.0, 5.0)
    noted.until(lambda: noted.tap.faults)
    noted.feed._hang_s = 2.0
    noted.give(how)

    def died() -> bool:
        noted.give(0.0)  # as samples go on to come
        return noted.feed.fault is not None

    noted.until(died)
    noted.feed._hang_s = 240.0
    assert not noted.tap.faults, "a fault that nobody looks at any more is not told"
    assert noted.notes[-1]["bad"] is False
    noted.give(0.0, 5.0)
    noted.until(lambda: noted.tap.faults)
    noted.feed.close()
    assert "died 1 times and are started again" in noted.feed.fault


@pytest.mark.slow
def test_what_a_process_found_before_it_died_is_taken_back_however_late_it_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(signal_feed, "PATIENCE_S", 240.0)
    noted = Noted(tmp_path, hang_s=240.0)
    hear, late = noted.tap.hear, []

    def hear_late(answer: dict[str, object]) -> None:
        if answer["changes"] and not late:
            late.append(answer)
            ends = time.monotonic() + 2.0  # as a thread that is held up while the process dies
            while noted.feed.fault is None and time.monotonic() < ends:
                noted.give(0.0)
                time.sleep(0.02)
        hear(answer)

    monkeypatch.setattr(noted.tap, "hear", hear_late)
    noted.give(0.0, 5.0)
    noted.give(2.0)
    noted.until(lambda: noted.feed.fault is not None and [n["bad"] for n in noted.notes])
    noted.feed.close()
    assert [n["bad"] for n in noted.notes] == [True, False]
    assert not noted.tap.faults


@pytest.mark.slow
def test_samples_wait_for_no_monitor(tmp_path: Path) -> None:
    noted = Noted(tmp_path, hang_s=3600.0)
    noted.give(0.0, 5.0)
    noted.until(lambda: noted.tap.faults)
    for _ in range(1000):
        noted.give(3.0)  # the first makes it sleep for longer than any test may take
    assert noted.feed.fault is None
    noted.feed.close()


@pytest.mark.slow
def test_monitors_that_die_again_and_again_are_left_out(tmp_path: Path) -> None:
    noted = Noted(tmp_path)

    def gone() -> bool:
        noted.give(2.0)
        return f"died {LIVES} times" in str(noted.feed.fault)

    noted.until(gone)
    noted.give(2.0)
    noted.feed.close()
    assert noted.feed.fault.endswith("left out from now on")


# ------------------------------------------------------------------------------ participant file


def note(time_s: float, *, bad: bool, channel: str = "Cz") -> Note:
    what = {"channel": channel, "kind": "flat line", "message": "does not move"}
    return Note(time_s, {"event": "signal", **what, "bad": bad, "samples": [0, 1]})


def written(notes: Sequence[Note], trials: Sequence[tuple[float, float]], path: Path) -> h5py.File:
    events = []
    for number, (start, end) in enumerate(trials, start=1):
        about = {"trial": number, "attempt": 1}
        events += [SimpleNamespace(name="trial.start", time=start, data=about)]
        events += [SimpleNamespace(name="trial.end", time=end, data=about)]
    log = SimpleNamespace(events=events, time=np.array([0.0, 1000.0]))
    stream = SimpleNamespace(header=StreamHeader("EEG", "EEG", (Channel("Cz"),)), notes=notes)
    file = h5py.File(path, "w")
    write_signal_faults(file, log, [stream])
    return file


def test_trials_are_flagged_with_the_faults_that_touch_them(tmp_path: Path) -> None:
    notes = [note(105.0, bad=True), note(131.0, bad=False), note(300.0, bad=True, channel="Pz")]
    trials = [(80.0, 90.0), (95.0, 101.0), (110.0, 120.0), (140.0, 150.0), (310.0, 320.0)]
    with written(notes, trials, tmp_path / "x.h5") as file:
        faults, touched = file["signal_faults"], file["trial_signal_faults"]
        assert faults["start"][:].tolist() == [105.0, 300.0]
        assert faults["end"][:].tolist() == [131.0, np.inf]
        # It may have begun 5 s before it was told: the second trial is touched for a second.
        assert touched["trial"][:].tolist() == [2.0, 3.0, 5.0]
        assert touched["seconds"][:].tolist() == [1.0, 10.0, 10.0]
        assert [text.decode() for text in touched["channel"][:]] == ["Cz", "Cz", "Pz"]


def test_a_fault_ends_with_the_monitors_that_told_it(tmp_path: Path) -> None:
    notes = [
        note(100.0, bad=True),
        Note(200.0, {"event": MONITORS, "names": []}),
        note(250.0, bad=False),
    ]
    with written(notes, [], tmp_path / "x.h5") as file:
        assert file["signal_faults/end"][:].tolist() == [200.0]


def test_a_session_without_faults_has_no_such_table(tmp_path: Path) -> None:
    with written([], [(0.0, 1.0)], tmp_path / "x.h5") as file:
        assert list(file) == []


# ----------------------------------------------------------------------------------- the watch


def test_skew_chunks_jitter_gaps_and_delay_are_measured() -> None:
    rng = np.random.default_rng(4)
    skew, offset, delay = rng.uniform(-200.0, 200.0), rng.uniform(-1e5, 1e5), rng.uniform(0.01, 0.2)
    chunk = int(rng.integers(5, 50))
    meter = StreamMeter(250.0)
    for number in range(250 * 20 // chunk):
        stamps = (np.arange(chunk) + number * chunk) / 250.0
        if number == 3:
            stamps = stamps[:0]  # one chunk is lost
        meter.take(stamps[-1] + offset + delay if len(stamps) else offset, stamps)
    for local in np.arange(0.0, 20.0, 0.5):
        trip = rng.choice([1e-4, 5e-3])
        late = 0.0 if trip < 1e-3 else 2e-3
        drift = -skew * 1e-6 * (local - 19.5)
        meter.probe(Probe(local, offset + drift + late, trip, local + offset))
    reading = meter.reading(now=offset + 20.0)
    assert reading.rate_hz == pytest.approx(250.0, rel=0.02)
    assert (reading.chunk, reading.largest_chunk) == (chunk, chunk)
    assert reading.jitter == pytest.approx(0.0, abs=1e-9)
    assert reading.gaps == 1
    assert reading.longest_gap == pytest.approx((chunk + 1) / 250.0)
    assert reading.skew_ppm == pytest.approx(skew, abs=1.0)
    assert reading.delay == pytest.approx(delay, abs=3e-3)
    assert reading.rtt == pytest.approx(1e-4)


def test_who_begins_to_watch_within_a_chunk_sees_no_gap_since_the_clock_was_at_zero() -> None:
    meter = StreamMeter(250.0)
    meter.take(5000.0, np.arange(1, 12) / 250.0)  # as LSL counts what has no stamp
    for number in range(1, 40):
        stamps = 5000.0 + (np.arange(16) + 16 * (number - 1)) / 250.0
        meter.take(stamps[-1] + 0.002, stamps)
    meter.probe(Probe(5000.0, 0.0, 1e-4, 5000.0))
    reading = meter.reading(now=5003.0)
    assert reading.rate_hz == pytest.approx(250.0)
    assert (reading.gaps, reading.disorder, reading.samples) == (0, 0, 11 + 39 * 16)
    assert reading.largest_delay == pytest.approx(0.004)


def test_disorder_is_counted() -> None:
    meter = StreamMeter(100.0)
    meter.take(1.0, np.array([0.0, 0.02, 0.01, 0.03]))
    assert meter.reading(1.0).disorder == 1


def long_view(faults: tuple[SignalFault, ...]) -> StreamView:
    channels = tuple(SignalChannel(f"E{at}", "microvolts") for at in range(64))
    stream = SignalStream("BrainVision amplifier of room 12", "EEG", 1000.0, channels)
    reading = StreamReading(
        123456,
        rate_hz=999.87,
        chunk=20,
        largest_chunk=340,
        jitter=0.00123,
        gaps=12,
        longest_gap=1.25,
        missing=4,
        disorder=2,
        delay=0.012,
        largest_delay=0.4,
        offset=-12345.678901,
        rtt=0.00031,
        skew_ppm=-43.2,
        silent=0.01,
    )
    return StreamView(stream.name, "lab-pc", stream, reading, faults, watched=True, trouble=())


def test_the_watch_fits_eighty_columns_and_cuts_nothing_off() -> None:
    faults = tuple(SignalFault(f"E{at}", "mains hum", f"{at} µV at 50 Hz") for at in range(64))
    lines = list(watched_lines(long_view(faults)))
    assert max(map(len, lines)) <= 80
    text = " ".join(" ".join(lines).split())
    for words in (
        "BrainVision amplifier of room 12: EEG, 64 channels at 1000 Hz, in microvolts",
        "clock -12345.678901 s, -43.2 ppm, round trip 0.31 ms",
        "20 at once, 340 at most, jitter 1.23 ms",
        "12 gaps, the longest 1.250 s, 4 lost by its counter, 2 timestamps out of order",
        "E0, E1, E2, E3, E4, E5 and 58 more: MAINS HUM: E0 0 µV at 50 Hz",
    ):
        assert words in text
    assert "signal alive" in " ".join(" ".join(watched_lines(long_view(()))).split())
