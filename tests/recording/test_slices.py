"""Columns read as slices, and sessions put together, in memory that does not grow with length."""

import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from recording.journals import COLUMNS, frames, stamp, write

from labcrane import RecordingError, open_recording
from labcrane.core import Event
from labcrane.recording.journal import Column, SessionJournal
from labcrane.recording.participant_file.column_writer import ColumnWriter
from labcrane.recording.participant_file.writer import consolidate
from labcrane.recording.xdf.file_bytes import WINDOW, FileBytes

COUNT = 500


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("P001")
    journal = write(folder / "ses-01_run.xdf", COUNT)
    return consolidate(folder / "P001.h5", [journal]).path


def test_a_column_is_read_as_numpy_slices_it(path: Path) -> None:
    whole = frames(COUNT)
    streams = open_recording(path).session(1).streams
    rng = np.random.default_rng()
    for number, column in enumerate(COLUMNS):
        start, stop = sorted(rng.integers(-COUNT - 9, COUNT + 9, 2).tolist())
        stream = streams[column.group]
        np.testing.assert_array_equal(
            stream.column(column.label, start, stop), whole[start:stop, number]
        )
        np.testing.assert_array_equal(stream.column(column.label), whole[:, number])
        np.testing.assert_array_equal(
            stream.column("time", start, stop),
            np.array([stamp(tick) for tick in range(COUNT)])[start:stop],
        )
        assert len(stream) == COUNT


def test_an_unknown_column_is_refused_with_those_that_there_are(path: Path) -> None:
    group = COLUMNS[0].group
    stream = open_recording(path).session(1).streams[group]
    for ask in (lambda: stream.column("boom"), lambda: stream.table(["boom"])):
        with pytest.raises(
            RecordingError, match=rf"has no column 'boom'; it has .*{COLUMNS[0].label}"
        ):
            ask()


def test_batches_are_the_table_whatever_their_size(path: Path) -> None:
    for stream in open_recording(path).session(1).streams.values():
        expected = stream.data
        for rows in np.random.default_rng().integers(1, COUNT + 9, 3).tolist():
            batches = list(stream.batches(rows=rows))
            assert max(map(len, batches)) <= rows
            for name in expected:
                got = np.concatenate([batch.column(name).to_numpy() for batch in batches])
                np.testing.assert_array_equal(got, expected[name])
        part = stream.table(start=7, stop=19)
        assert part.column_names == ["time", *expected]
        np.testing.assert_array_equal(part["time"].to_numpy(), stream.time[7:19])


@pytest.mark.parametrize("count", [0, 1, 63, 64, 65, 70_000])
def test_columns_written_a_piece_at_a_time_are_what_hdf5_reads(tmp_path: Path, count: int) -> None:
    rng = np.random.default_rng()
    rows = rng.standard_normal((count, 3))
    rows[rng.random((count, 3)) < 0.1] = np.nan
    with h5py.File(tmp_path / "x.h5", "w") as file:
        writer = ColumnWriter(file, [("a/b", "m"), ("a/c", "s"), ("d", "1")], count)
        at = 0
        while at < count:
            more = int(rng.integers(1, 40_000))
            writer.write(rows[at : at + more])
            at += more
        writer.close()
    with h5py.File(tmp_path / "x.h5") as file:
        for number, name in enumerate(("a/b", "a/c", "d")):
            np.testing.assert_array_equal(file[name][:], rows[:, number])
        assert file["a/b"].attrs["unit"] == "m"


def test_columns_that_lack_rows_are_no_columns(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "x.h5", "w") as file:
        writer = ColumnWriter(file, [("a", "m")], 100)
        writer.write(np.zeros((99, 1)))
        with pytest.raises(ValueError, match="99 of 100 rows were written"):
            writer.close()


def test_a_window_of_a_file_finds_what_the_whole_file_has(tmp_path: Path) -> None:
    rng = np.random.default_rng()
    content = bytearray(rng.integers(0, 3, 2 * WINDOW + 1000, np.uint8).tobytes())
    needle = b"\x07needle\x07"
    for at in (*rng.integers(0, len(content) - 8, 5).tolist(), WINDOW - 3, len(content) - 8):
        content[at : at + 8] = needle
    whole = bytes(content)
    (tmp_path / "x").write_bytes(whole)
    found = FileBytes(tmp_path / "x")
    assert len(found) == len(whole)
    for _ in range(20):
        start, stop = sorted(rng.integers(0, len(whole) + 1, 2).tolist())
        assert found.find(needle, start, stop) == whole.find(needle, start, stop)
        assert found.rfind(needle, start, stop) == whole.rfind(needle, start, stop)
        assert found[start:stop] == whole[start:stop]


def test_a_file_that_becomes_shorter_while_it_is_read_is_told(tmp_path: Path) -> None:
    path = tmp_path / "x"
    path.write_bytes(bytes(3 * WINDOW))
    found = FileBytes(path)
    path.write_bytes(b"")
    with pytest.raises(RecordingError, match=r"x has become shorter while it was read"):
        found[2 * WINDOW : 2 * WINDOW + 10]


MEASURED = """
import sys
from pathlib import Path
from labcrane.recording.participant_file.writer import consolidate
folder = Path(sys.argv[1])
consolidate(folder / "P001.h5", [folder / "ses-01_run.xdf"])
lines = Path("/proc/self/status").read_text().splitlines()
print(next(int(line.split()[1]) for line in lines if line.startswith("VmHWM:")))
"""


@pytest.mark.long
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_a_session_three_times_as_long_takes_stamps_more_and_not_samples(tmp_path: Path) -> None:
    """A frame of 40 columns has 345 bytes in the journal; kept of it are its stamp, and copies."""
    columns = tuple(Column("state", f"signal.{number}", "1") for number in range(40))
    used = {}
    for count in (100_000, 300_000):
        folder = tmp_path / str(count)
        folder.mkdir()
        rows = np.random.default_rng(1).standard_normal((1000, len(columns)))
        with SessionJournal(folder / "ses-01_run.xdf", columns, 1000.0) as journal:
            journal.write_event(Event("session.start", 0.0, {"participant": "P001"}), 0)
            for at in range(0, count, 1000):
                journal.write_frames((at + np.arange(1000.0)) / 1000, rows)
        words = [sys.executable, "-c", MEASURED, str(folder)]
        used[count] = 1024 * int(subprocess.check_output(words))
    assert used[300_000] - used[100_000] < 200_000 * 100
