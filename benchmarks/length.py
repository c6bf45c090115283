"""Length: an hour at 1 kHz with 40 columns, consolidated, read and exported.

    python -m benchmarks.length [--minutes 60]

Each figure comes from a separate process: processor seconds, so that other programs on the computer
matter little, and the maximum of memory in MB. The references are the performance targets, and for
two of the times also a bare library.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.table import Row, show
from labcrane.core.records import Event
from labcrane.recording.journal import Column, SessionJournal
from labcrane.recording.paths import journal_path

COLUMNS = tuple(Column("state", f"signal.{number}", "1") for number in range(40))
RATE_HZ = 1000.0
PIECE = 60_000

HEAD = """
import json, sys, time
from pathlib import Path
folder = Path(sys.argv[1])
def report():
    lines = Path("/proc/self/status").read_text().splitlines()
    most = next(int(line.split()[1]) for line in lines if line.startswith("VmHWM:"))
    print(json.dumps([time.process_time() - began, most / 1024]))
"""
OURS = """
from labcrane.recording.participant_file.reader import open_recording
began = time.process_time()
column = open_recording(folder / "P001.h5").session(1).streams["state"].column("signal.7")
assert len(column) == int(sys.argv[2])
report()
"""
BARE = """
import h5py
began = time.process_time()
with h5py.File(folder / "P001.h5") as file:
    assert len(file["ses-01/state/signal/7"][:]) == int(sys.argv[2])
report()
"""
RECOVER = """
from labcrane.recording.participant_file.recover import recover
began = time.process_time()
(done,) = recover(folder)
assert done.done.frames == int(sys.argv[2])
report()
"""
EXPORT = """
from labcrane.recording.participant_file.reader import open_recording
from labcrane_tables.frames import stream_tables
from labcrane_tables.tables import write_parquet
began = time.process_time()
for table in stream_tables(open_recording(folder / "P001.h5").session(1)):
    write_parquet(table, folder / "ours.parquet")
report()
"""
PLAIN = """
import h5py
import pyarrow as pa
from pyarrow import parquet
began = time.process_time()
with h5py.File(folder / "P001.h5") as file:
    group = file["ses-01/state/signal"]
    table = pa.table({name: group[name][:] for name in group} | {"time": file["ses-01/time"][:]})
    parquet.write_table(table, folder / "bare.parquet", use_dictionary=False)
report()
"""


MINUTES = 60.0


def rows(*, brief: bool = False) -> list[Row]:
    """Return all figures of an hour."""
    return rows_of(0.1 if brief else MINUTES)


def rows_of(minutes: float) -> list[Row]:
    """Return all figures of a session so long."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "P001"
        count = record(folder, minutes)
        recovered = used(RECOVER, folder, count)
        ours, bare = (min(used(code, folder, count) for _ in range(3)) for code in (OURS, BARE))
        exported, plain = (used(code, folder, count) for code in (EXPORT, PLAIN))
    size = f"{minutes:g} min at 1 kHz, 40 columns"
    promised = "promised"
    return [
        Row("length", f"{size}: recover, s", recovered[0], 15.0, promised, 1.0),
        Row("length", f"{size}: recover, MB at most", recovered[1], 200.0, promised, 1.0),
        Row("length", f"{size}: open and read a column, s", ours[0], 0.3, promised, 1.0),
        Row("length", f"{size}: open and read a column, MB", ours[1], 100.0, promised, 1.0),
        Row("length", f"{size}: read a column, s", ours[0], bare[0], "h5py alone", 2.2),
        Row("length", f"{size}: export, s", exported[0], plain[0], "h5py to pyarrow", 1.1),
        Row("length", f"{size}: export, MB at most", exported[1], plain[1], "the same", 0.26),
    ]


def record(folder: Path, minutes: float) -> int:
    """Write a journal as a loop does, a frame at a time; return how many frames it has."""
    folder.mkdir(parents=True)
    count = int(minutes * 60 * RATE_HZ)
    dice = np.random.default_rng(1)
    speeds = dice.uniform(0.1, 2.0, len(COLUMNS))
    with SessionJournal(journal_path(folder, 1, "run"), COLUMNS, RATE_HZ) as journal:
        journal.write_event(Event("session.start", 0.0, {"participant": "P001"}), 0)
        for start in range(0, count, PIECE):
            time_s = np.arange(start, min(start + PIECE, count)) / RATE_HZ
            noise = 1e-6 * dice.standard_normal((len(time_s), len(COLUMNS)))
            for stamp, row in zip(time_s, np.sin(time_s[:, None] * speeds) + noise, strict=True):
                journal.write_frame(float(stamp), row)
    return count


def used(code: str, folder: Path, count: int) -> tuple[float, float]:
    """Return the processor's seconds and the MB at most that a program needs."""
    words = [sys.executable, "-c", HEAD + code, str(folder), str(count)]
    seconds, megabytes = json.loads(subprocess.check_output(words).splitlines()[-1])
    return seconds, megabytes


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=MINUTES)
    show(rows_of(parser.parse_args().minutes))
