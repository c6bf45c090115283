import errno
import json
import os
import threading
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
import pyxdf
from recording.journals import write

from labcrane import RecordingError, open_recording
from labcrane.files.lock import alone_in
from labcrane.recording import Channel, StreamHeader, XdfWriter
from labcrane.recording.foreign_streams import (
    RecordedStream,
    companion_headers,
)
from labcrane.recording.participant_file.recorrect import read_stream, recorrect
from labcrane.recording.participant_file.recover import recover
from labcrane.recording.participant_file.stream_group import write_time, write_uncorrected
from labcrane.recording.participant_file.writer import consolidate
from labcrane.session import postprocess

EEG = StreamHeader(
    "EEG / 1",
    "EEG",
    (Channel("Fz", "microvolts"), Channel("Cz", "microvolts"), Channel("Fz", "microvolts")),
    "float32",
    500.0,
    "amp-7",
)
NOTES = StreamHeader("Keys", "Markers", (Channel("key"),), "string", 0.0, "kb")
SILENT = StreamHeader("Gaze", "Gaze", (Channel("x"),), "double64", 200.0)


def record(path: Path, count: int, first: int = 0) -> Path:
    """Write a journal as the recorder does."""
    with XdfWriter(path) as writer:
        eeg = writer.add_stream(EEG)
        beside = {
            kind: writer.add_stream(header) for kind, header in companion_headers(EEG, eeg).items()
        }
        keys, _ = writer.add_stream(NOTES), writer.add_stream(SILENT)
        stamps = np.arange(first, first + count) / 500
        data = np.outer(np.arange(first, first + count), [1, 2, 3]).astype(np.float32)
        writer.write_samples(eeg, stamps, data)
        writer.write_texts(keys, [5.0, 6.0], [["a"], ["ż"]])
        writer.write_sample(beside["probes"], 9.0, np.array([1.0, 8.0, 1e-4, 9.0]))
        writer.write_offset(eeg, 1.0, 8.0)
        writer.write_sample(beside["arrivals"], 9.1, np.array([count, 9.1]))
        note = {"event": "reset", "samples": [0, count]}
        writer.write_texts(beside["notes"], [9.2], [[json.dumps(note)]])
    return path


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    folder = tmp_path / "P001"
    folder.mkdir()
    write(folder / "ses-01_run.xdf", 10)
    record(folder / "ses-01_streams.xdf", 1000)
    return folder


def test_everything_known_of_a_stream_is_in_the_participant_file(folder: Path) -> None:
    (done,) = recover(folder)
    assert done.done is not None
    assert done.done.streams == {"EEG / 1": 1000, "Keys": 2, "Gaze": 0}
    session = open_recording(folder / "P001.h5").session(1)
    eeg = session.streams["EEG _ 1"]
    np.testing.assert_array_equal(eeg.time, np.arange(1000) / 500)
    np.testing.assert_array_equal(eeg.data.to_numpy(), np.outer(np.arange(1000), [1, 2, 3]))
    assert eeg.attrs["name"] == "EEG / 1"
    assert eeg.attrs["corrected"] is False
    assert list(session.streams["Keys"].data["key"]) == ["a", "ż"]
    assert len(session.streams["Gaze"].time) == 0
    with h5py.File(folder / "P001.h5") as file:
        group = file["ses-01/streams/EEG _ 1"]
        assert sorted(group["data"]) == ["Cz", "Fz", "Fz-2"]
        assert group["clock/rtt"][:].tolist() == [1e-4]
        assert group["arrival/count"][:].tolist() == [1000.0]
        assert group["offsets/value"][:].tolist() == [8.0]
        assert group["header"].asstr()[()] == EEG.xml
        assert json.loads(group["notes/data"].asstr()[0])["event"] == "reset"


def test_nanoseconds_of_an_int64_stream_keep_every_bit(folder: Path) -> None:
    """They became float64, and lost their last 8 bits."""
    header = StreamHeader(
        "Clocks", "Clocks", (Channel("ns", "ns"), Channel("count", "1")), "int64", 0.0, "card"
    )
    rows = np.array([[1_700_000_000_123_456_789, 3], [-9_007_199_254_740_993, -4]])
    with XdfWriter(folder / "ses-01_streams.part2.xdf") as writer:
        writer.write_samples(writer.add_stream(header), np.array([1.0, 2.0]), rows)
    assert recover(folder)[0].done is not None
    stream = open_recording(folder / "P001.h5").session(1).streams["Clocks"]
    assert stream.column("ns").tolist() == rows[:, 0].tolist()
    assert stream.numeric == ["ns", "count"]
    with h5py.File(folder / "P001.h5") as file:
        kinds = {name: each.dtype for name, each in file["ses-01/streams/Clocks/data"].items()}
    assert kinds == {"ns": np.int64, "count": np.float64}
    # Reading back, as a correction does, and writing again changes nothing.
    recorrect(folder / "P001.h5", as_they_are)
    again = open_recording(folder / "P001.h5").session(1).streams["Clocks"]
    assert again.column("ns").tolist() == rows[:, 0].tolist()
    assert again.data["count"].tolist() == [3.0, -4.0]


def test_parts_of_a_stream_are_joined_where_its_source_is_the_same(folder: Path) -> None:
    record(folder / "ses-01_streams.part2.xdf", 500, first=2000)
    seen: dict[str, RecordedStream] = {}

    def conclude(group: h5py.Group) -> None:
        for one in group["streams"].values():
            stream = seen[str(one.attrs["name"])] = read_stream(one)
            later = {"time": stream.time_raw + 8.0}
            write_time(one, later, {"residual_p95": 1e-5, "verdict": "PASS"})

    journals = [folder / "ses-01_run.xdf", folder / "ses-01_streams.xdf"]
    consolidate(folder / "P001.h5", journals, conclude)
    eeg = seen["EEG / 1"]
    assert eeg.starts == (0, 1000)
    assert [note.data["samples"] for note in eeg.notes] == [[0, 1000], [1000, 1500]]
    np.testing.assert_array_equal(eeg.arrivals, [[1000, 9.1], [1500, 9.1]])
    session = open_recording(folder / "P001.h5").session(1)
    stream = session.streams["EEG _ 1"]
    np.testing.assert_array_equal(stream.time, eeg.time_raw + 8.0)
    np.testing.assert_array_equal(stream.time_raw, eeg.time_raw)
    assert stream.attrs["verdict"] == "PASS"
    assert stream.attrs["residual_p95"] == 1e-5
    assert "Gaze-2" in session.streams  # no source id, so nobody knows that it is the same


def uncorrected(group: h5py.Group) -> None:
    for stream in group["streams"].values():
        write_uncorrected(stream, f"no probes for {stream.attrs['name']}")


def test_a_clock_that_cannot_be_corrected_costs_no_session(folder: Path) -> None:
    (done,) = recover(folder, uncorrected)
    assert done.problem == ""
    eeg = open_recording(folder / "P001.h5").session(1).streams["EEG _ 1"]
    assert eeg.attrs["uncorrected"] == "no probes for EEG / 1"
    np.testing.assert_array_equal(eeg.time, eeg.time_raw)


def test_what_nobody_foresaw_of_a_clock_costs_no_session_and_is_in_the_report(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise IndexError("of a device that nobody has seen")

    monkeypatch.setattr(postprocess, "correct", fail)
    (done,) = recover(folder, lambda group: postprocess.conclude(group) and None)
    assert done.problem == ""
    session = open_recording(folder / "P001.h5").session(1)
    assert "that nobody has seen" in session.streams["EEG _ 1"].attrs["uncorrected"]
    np.testing.assert_array_equal(session.streams["EEG _ 1"].data["Fz"], np.arange(1000.0))
    assert session.sync_report["verdict"] == "FAIL"
    assert "could not be corrected: IndexError('of a device" in json.dumps(session.sync_report)


def test_a_session_of_streams_alone_is_a_session(folder: Path) -> None:
    (folder / "ses-01_run.xdf").unlink()
    (done,) = recover(folder)
    assert done.problem == ""
    session = open_recording(folder / "P001.h5").session(1)
    assert list(session.streams) == ["EEG _ 1", "Gaze", "Keys"]
    assert len(session.events) == len(session.trials) == 0


def test_pyxdf_reads_the_streams_beside(folder: Path) -> None:
    streams, _ = pyxdf.load_xdf(folder / "ses-01_streams.xdf", dejitter_timestamps=False)
    named = {stream["info"]["name"][0]: stream for stream in streams}
    assert named["EEG / 1|probes"]["info"]["desc"][0]["of"] == ["1"]
    assert named["EEG / 1|probes"]["time_series"].tolist() == [[1.0, 8.0, 1e-4, 9.0]]
    np.testing.assert_allclose(named["EEG / 1"]["time_stamps"], np.arange(1000) / 500 + 8.0)


def as_they_are(group: h5py.Group) -> None:
    for stream in group["streams"].values():
        write_time(stream, {"time": stream["time_raw"][:]}, {})


def test_clocks_that_are_corrected_later_are_no_longer_uncorrected(folder: Path) -> None:
    recover(folder, uncorrected)
    path = folder / "P001.h5"
    assert recorrect(path, as_they_are) == {1: ["EEG _ 1", "Gaze", "Keys"]}
    eeg = open_recording(path).session(1).streams["EEG _ 1"]
    assert eeg.attrs["corrected"] is True
    assert "uncorrected" not in eeg.attrs


def test_a_disk_that_refuses_new_corrections_leaves_the_file_as_it_was(folder: Path) -> None:
    recover(folder)
    path = folder / "P001.h5"
    before, beside = path.read_bytes(), sorted(folder.iterdir())

    def full(group: h5py.Group) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with pytest.raises(RecordingError, match=r"No space left .* and run labcrane resync .*P001.h5"):
        recorrect(path, full)
    assert path.read_bytes() == before
    assert sorted(folder.iterdir()) == beside


def test_correcting_again_waits_for_whoever_writes_the_participant_file(folder: Path) -> None:
    recover(folder)
    path, entered = folder / "P001.h5", threading.Event()

    def conclude(group: h5py.Group) -> None:
        entered.set()

    again = threading.Thread(target=recorrect, args=(path, conclude))
    with alone_in(folder):
        again.start()
        assert not entered.wait(0.5)
    again.join(240)
    assert entered.is_set()


def test_correcting_a_file_that_is_not_there_says_what_makes_one(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"no participant file .*; if there are journals"):
        recorrect(tmp_path / "nobody" / "P009.h5", as_they_are)


def test_times_of_before_stand_beside_better_ones(folder: Path) -> None:
    def later(seconds: float) -> Callable[[h5py.Group], None]:
        def conclude(group: h5py.Group) -> None:
            for stream in group["streams"].values():
                time = stream["time_raw"][:] + seconds
                error = np.full(len(time), 2e-4)
                basis = np.zeros(len(time))
                columns = {"time": time, "time_error": error, "time_basis": basis}
                write_time(stream, columns, {"offset": seconds})

        return conclude

    recover(folder, later(8.0))
    path = folder / "P001.h5"
    for _ in range(2):  # the second time nothing is better
        recorrect(path, later(8.1))
    stream = open_recording(path).session(1).streams["EEG _ 1"]
    np.testing.assert_allclose(stream.time, stream.time_raw + 8.1)
    np.testing.assert_allclose(stream.time_error, 2e-4)  # s, as the file and labcrane.clocks say
    assert set(stream.time_basis) == {"probes"}
    with h5py.File(path) as file:
        earlier = file["ses-01/streams/EEG _ 1/earlier"]
        assert list(earlier) == ["time-1"]
        np.testing.assert_allclose(earlier["time-1"][:], stream.time_raw + 8.0)
        assert earlier["time-1"].attrs["offset"] == 8.0
