"""Recording, against the least it could cost: ``python -m benchmarks.recording``.

Everything that is compared runs in the same process, in turns, on the same disk. Times on a shared
computer are noise; the ratios are what counts.
"""

import argparse
import os
import statistics
import tempfile
import time
import zlib
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pyxdf

from benchmarks.table import Row
from labcrane.core.records import Event
from labcrane.recording.journal import Column, SessionJournal
from labcrane.recording.participant_file.reader import open_recording
from labcrane.recording.participant_file.writer import consolidate
from labcrane.recording.xdf.reader import read_xdf

COLUMNS = tuple(Column("state", f"signal.{number}", "1") for number in range(40))
RATE_HZ = 240.0
BLOCK = 200


def a_movement(count: int) -> np.ndarray:
    """Return frames like those of a session: smooth, with noise in the last digits."""
    rng = np.random.default_rng(1)
    phase = np.arange(count)[:, None] / RATE_HZ * rng.uniform(0.1, 2.0, len(COLUMNS))
    return np.sin(phase) + 1e-6 * rng.standard_normal((count, len(COLUMNS)))


def timed(call: Callable[[], object]) -> float:
    """Return how long a call takes, in seconds."""
    began = time.perf_counter()
    call()
    return time.perf_counter() - began


def rows(*, brief: bool = False) -> list[Row]:
    """Return all ratios of a recording of five minutes."""
    minutes = 0.1 if brief else 5.0
    found: list[Row] = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        data = a_movement(int(60.0 * minutes * RATE_HZ))
        journal = write_through(folder, data, 0.0, found)
        consolidation(folder, journal, data, found)
        loading(journal, found)
    return found


def write_through(
    folder: Path, rows: np.ndarray, pause_s: float, found: list[Row] | None = None
) -> Path:
    """Print what one frame costs: ours, and the three calls that it cannot do without, in turns.

    They are whether the file is still there, its checksum, and the write
    (docs/decisions/0003-recordings-verify-themselves.md).
    """
    path, crc = folder / "ses-01_run.xdf", 0
    bare = os.open(folder / "bare", os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    ours: list[float] = []
    theirs: list[float] = []
    with SessionJournal(path, COLUMNS, RATE_HZ) as journal:
        journal.write_event(Event("session.start", 0.0, {"participant": "P001"}), 0)
        size = 25 + rows[0].nbytes
        for start in range(0, len(rows), BLOCK):
            block = rows[start : start + BLOCK]
            for number, row in enumerate(block, start):
                if pause_s:
                    time.sleep(pause_s)
                stamp = number / RATE_HZ
                began = time.perf_counter()
                journal.write_frame(stamp, row)
                ours.append(time.perf_counter() - began)
            for row in block:
                if pause_s:
                    time.sleep(pause_s)
                content = bytes(size - row.nbytes) + row.tobytes()
                began = time.perf_counter()
                os.stat(path)  # noqa: PTH116 - as the recorder does
                crc = zlib.crc32(content, crc)
                os.write(bare, content)
                theirs.append(time.perf_counter() - began)
    os.close(bare)
    show(f"write_frame, {'paced' if pause_s else 'back to back'}", ours)
    show("os.stat, crc32, os.write", theirs)
    print(f"    ratio of medians {statistics.median(ours) / statistics.median(theirs):.2f}")
    if found is not None:
        us = [1e6 * statistics.median(times) for times in (ours, theirs)]
        found.append(Row("recording", "a frame, us", *us, "os.stat, crc32, os.write", 2.5))
    return path


def show(name: str, seconds: list[float]) -> None:
    """Print the median, the 99th percentile and the worst."""
    middle, high, top = np.percentile(np.array(seconds) * 1e6, [50, 99, 100])
    print(f"{name:32} p50 {middle:6.1f} us   p99 {high:6.1f} us   max {top:8.1f} us")


def plain_hdf5(path: Path, time_s: np.ndarray, rows: np.ndarray, **filters: object) -> None:
    """Write the same arrays with nothing but h5py."""
    with h5py.File(path, "w") as file:
        file.create_dataset("time", data=time_s, **filters)
        for number in range(rows.shape[1]):
            file.create_dataset(f"c{number}", data=rows[:, number], **filters)
    with path.open("rb") as written:
        os.fsync(written.fileno())


def consolidation(
    folder: Path, journal: Path, rows: np.ndarray, found: list[Row] | None = None
) -> None:
    """Print how fast a journal becomes a participant file, against plain h5py."""
    size = rows.nbytes / 1e6
    times = np.arange(len(rows)) / RATE_HZ
    filters = {
        "compression": "gzip",
        "compression_opts": 1,
        "shuffle": True,
        "chunks": (min(1 << 16, len(rows)),),
    }
    same = timed(lambda: plain_hdf5(folder / "same.h5", times, rows, **filters))
    bare = timed(lambda: plain_hdf5(folder / "bare.h5", times, rows))
    ours = timed(lambda: consolidate(folder / "P001.h5", [journal]))
    print(f"journal {journal.stat().st_size / 1e6:.0f} MB for {size:.0f} MB of numbers")
    print(f"consolidate (read, check, write, verify)  {ours:6.2f} s {size / ours:7.0f} MB/s")
    print(f"h5py alone, same filters                  {same:6.2f} s {size / same:7.0f} MB/s")
    print(f"h5py alone, no filters                    {bare:6.2f} s {size / bare:7.0f} MB/s")
    print(f"    ratio {ours / same:.2f} to h5py with the same filters")
    if found is not None:
        found.append(Row("recording", "consolidation, s", ours, same, "h5py, same filters", 1.25))
    print(f"    file {(folder / 'P001.h5').stat().st_size / 1e6:.0f} MB")
    read = timed(lambda: open_recording(folder / "P001.h5").session(1).streams["state"].data)
    print(f"open_recording, all state columns         {read:6.2f} s {size / read:7.0f} MB/s")


def loading(journal: Path, found: list[Row] | None = None) -> None:
    """Print how long it takes to read a journal, against pyxdf."""
    options = {"dejitter_timestamps": False, "synchronize_clocks": False}
    ours = timed(lambda: read_xdf(journal))
    theirs = timed(lambda: pyxdf.load_xdf(journal, **options))
    print(f"read_xdf, with all checks                 {ours:6.2f} s")
    print(f"pyxdf.load_xdf                            {theirs:6.2f} s")
    print(f"    ratio {theirs / ours:.1f}")
    if found is not None:
        found.append(Row("recording", "reading a journal, s", ours, theirs, "pyxdf", 0.17))


def main() -> None:
    """Run all comparisons."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0, help="length of the recording")
    parser.add_argument("--folder", type=Path, help="where to write, on the disk of interest")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=given.folder) as name:
        folder = Path(name)
        paced = folder / "paced"
        paced.mkdir()
        write_through(paced, a_movement(5 * int(RATE_HZ)), 1.0 / RATE_HZ)
        rows = a_movement(int(given.minutes * 60 * RATE_HZ))
        journal = write_through(folder, rows, 0.0)
        consolidation(folder, journal, rows)
        loading(journal)


if __name__ == "__main__":
    main()
