"""Journals of recorders that lived at once, and died at random."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from labcrane.recording import Channel, StreamHeader, XdfWriter
from labcrane.recording.foreign_streams import OPENED, RESET, SIGNAL, read_streams
from labcrane.recording.paths import part_path
from labcrane.streams.probes import Probe
from labcrane.streams.recorder.companions import RecordedStreamWriter
from labcrane.streams.sync.raw import raw_of

EEG = StreamHeader("EEG", "EEG", (Channel("count"), Channel("E1")), "float32", 500.0, "amp")
KEYS = StreamHeader("Keys", "Markers", (Channel("key"),), "string", 0.0, "kb")


def record(path, header, whole, lives, random):
    """Write the part of a recorder that lived from one time to another; return what it had."""
    born, died = lives
    stamps, data, texts = whole
    mine = np.flatnonzero((stamps >= born) & (stamps < died))
    with XdfWriter(path) as writer:
        stream = RecordedStreamWriter(writer, header)
        stream.note(born, OPENED)
        done, now = 0, born
        while now < died:
            now = min(now + random.uniform(0.01, 0.2), died)
            came = mine[done:][stamps[mine[done:]] < now]
            if len(came):
                rows = (
                    data[came] if header.dtype is not None else [[texts[i].encode()] for i in came]
                )
                stream.samples(stamps[came], rows)
                done += len(came)
                stream.arrival(done, now)
            if random.random() < 0.2:
                stream.probe(Probe(now, 0.0, 1e-4, now))
                if done > 3 and random.random() < 0.2:
                    stream.note(now, RESET, samples=[done - 2, done])
    return mine


@pytest.mark.slow
@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32), st.sampled_from([EEG, KEYS]))
def test_what_any_recorder_had_is_there_once_and_in_order(tmp_path_factory, seed, header) -> None:
    random = np.random.default_rng(seed)
    folder: Path = tmp_path_factory.mktemp("parts")
    ends = 4.0
    stamps = np.sort(random.choice(np.arange(0.0, ends, 0.004), random.integers(1, 700)))
    data = np.column_stack([np.arange(len(stamps)), random.integers(0, 2, len(stamps))])
    texts = [random.choice(["a", "b"]) + str(i) for i in range(len(stamps))]
    whole = stamps, data.astype(np.float32), texts
    # Two at a time, each replaced some time after it has died.
    lives = []
    for _ in range(2):
        born = random.uniform(0.0, 0.3)
        while born < ends:
            died = born + random.exponential(1.5)
            lives.append((born, min(died, ends)))
            born = died + random.uniform(0.02, 0.6)
    lives.sort()
    first = folder / "ses-01_streams.xdf"
    paths = [part_path(first, number + 1) for number in range(len(lives))]
    had = [
        record(path, header, whole, life, random) for path, life in zip(paths, lives, strict=True)
    ]
    (stream,), _ = read_streams(paths)
    there = np.unique(np.concatenate(had))
    np.testing.assert_array_equal(stream.time_raw, stamps[there])
    if header is EEG:
        np.testing.assert_array_equal(stream.data, whole[1][there])
    else:
        assert [row[0] for row in stream.texts] == [texts[i] for i in there]
    counts, times = stream.arrivals.T if len(stream.arrivals) else np.empty((2, 0))
    assert (np.diff(counts) > 0).all()
    assert (np.diff(times) > 0).all()
    if len(counts):
        assert counts[-1] == len(there)
        last = stamps[there][counts.astype(int) - 1]
        assert (last < times).all()  # a sample has come when it is counted, not before
    # A new start for each time without any recorder, and none where one lived on.
    died, holes = -np.inf, 0
    for born, end in lives:
        holes += np.isfinite(died) and born > died
        died = max(died, end)
    assert 1 + holes <= len(stream.starts) <= len(lives)
    for note in stream.notes:
        if note.data["event"] == RESET:
            low, high = note.data["samples"]
            assert 0 <= low < high <= len(there)
            assert stamps[there][high - 1] < note.time
    resets = raw_of(stream).resets
    assert all(0 <= low < high <= len(there) for _, low, high in resets)


@pytest.mark.parametrize("told", [(0, 2), (2, 0), (2, 2), (1, 2)])
def test_signal_faults_are_told_once_by_the_monitors_that_told_more(tmp_path, told) -> None:
    first = tmp_path / "ses-01_streams.xdf"
    for number, count in enumerate(told, start=1):
        with XdfWriter(part_path(first, number)) as writer:
            stream = RecordedStreamWriter(writer, EEG)
            stream.note(0.001 * number, OPENED)
            stream.samples(np.arange(10.0), np.zeros((10, 2)))
            stream.arrival(10, 10.0)
            for bad in (True, False)[:count]:
                stream.note(4.0 if bad else 6.0, SIGNAL, bad=bad, samples=[3, 4])
    (stream,), _ = read_streams([part_path(first, number) for number in (1, 2)])
    said = [note.data["bad"] for note in stream.notes if note.data["event"] == SIGNAL]
    assert said == [True, False]
    assert [note.data["event"] for note in stream.notes].count(OPENED) == 2


def test_recorders_one_after_the_other_are_joined_as_they_are(tmp_path) -> None:
    """A device that begins anew with the same stamps and values is not taken for what was."""
    first = tmp_path / "ses-01_streams.xdf"
    paths = [part_path(first, 1), part_path(first, 2)]
    for number, path in enumerate(paths):
        with XdfWriter(path) as writer:
            stream = RecordedStreamWriter(writer, EEG)
            stream.note(100.0 * number, OPENED)
            stream.samples(np.arange(50.0), np.zeros((50, 2)))
            stream.arrival(50, 100.0 * number + 60.0)
            stream.note(100.0 * number + 61.0, RESET, samples=[40, 45])
    (stream,), _ = read_streams(paths)
    assert stream.starts == (0, 50)
    np.testing.assert_array_equal(stream.time_raw, np.r_[np.arange(50.0), np.arange(50.0)])
    resets = raw_of(stream).resets
    np.testing.assert_array_equal(resets[:, 1:], [[40, 45], [90, 95]])


def test_a_program_without_a_source_id_is_one_stream_while_it_runs(tmp_path) -> None:
    text = EEG.xml.replace("<source_id>amp</source_id>", "<source_id /><uid>{}</uid>")
    first = tmp_path / "ses-01_streams.xdf"
    paths = [part_path(first, number) for number in (1, 2, 3)]
    for path, uid in zip(paths, ("one", "one", "two"), strict=True):
        with XdfWriter(path) as writer:
            stream = RecordedStreamWriter(writer, StreamHeader.from_xml(text.format(uid)))
            stream.note(0.0, OPENED)
            stream.samples(np.arange(5.0), np.zeros((5, 2)))
            stream.arrival(5, 5.0)
    streams, _ = read_streams(paths)
    assert [len(stream.time_raw) for stream in streams] == [5, 5]
