"""Recordings made long: the same session, whose signals go on."""

import shutil
import sys
from pathlib import Path

import h5py
import numpy as np
from programs import ran

from labcrane.recording.journal import GROUPS


def lengthened(source: Path, target: Path, seconds: float) -> Path:
    """Copy a participant file with all signals of session 1 repeated until they last so long."""
    target.parent.mkdir(parents=True)
    shutil.copyfile(source, target)
    with h5py.File(target, "r+") as file:
        session = file["ses-01"]
        _repeat(session["time"], seconds, [session[name] for name in GROUPS if name in session])
        if "part" in session:
            _replace(
                session["part"],
                np.pad(
                    session["part"][:], (0, len(session["time"]) - len(session["part"])), "edge"
                ),
            )
        for stream in session.get("streams", {}).values():
            if "time" in stream and len(stream["time"]) > 1000:
                _repeat(stream["time"], seconds, [stream["data"]])
    return target


def _repeat(time: h5py.Dataset, seconds: float, groups: list[h5py.Group]) -> None:
    before = time[:]
    step = (before[-1] - before[0]) / (len(before) - 1)
    count = int(seconds / step)
    beyond = before[-1] + step * np.arange(1, count - len(before) + 1)
    _replace(time, np.concatenate([before, beyond]))
    columns: list[h5py.Dataset] = []
    for group in groups:
        group.visititems(
            lambda _, node: columns.append(node) if isinstance(node, h5py.Dataset) else None
        )
    for column in columns:
        # Trials do not come again: what goes on behind them is of the last one's time after it.
        again = "/loop/" not in column.name
        values = column[:]
        rest = (
            np.resize(values, count) if again else np.pad(values, (0, count - len(values)), "edge")
        )
        if column.name.endswith("/loop/due"):
            rest[len(values) :] = values[-1] + step * np.arange(1, count - len(values) + 1)
        _replace(column, rest)


def _replace(dataset: h5py.Dataset, values: np.ndarray) -> None:
    parent, name, attrs = dataset.parent, dataset.name, dict(dataset.attrs)
    del parent.file[name]
    made = parent.file.create_dataset(
        name, data=values, chunks=(min(len(values), 1 << 16),), compression="gzip", shuffle=True,
        compression_opts=1,
    )  # fmt: skip
    made.attrs.update(attrs)


MEASURED = """
import sys
from pathlib import Path
from labcrane.cli.app import main
status = main(sys.argv[1:])
lines = Path("/proc/self/status").read_text().splitlines()
print(next(int(line.split()[1]) for line in lines if line.startswith("VmHWM:")))
sys.exit(status)
"""
# ru_maxrss would not do: a program inherits it from the process that started it.


def megabytes(*words: object) -> float:
    """Return how much a command had in memory at most, in a process of its own."""
    run = [sys.executable, "-c", MEASURED, *map(str, words)]
    done = ran(run)
    assert done.returncode == 0, done.stderr
    return int(done.stdout.splitlines()[-1]) / 1024
