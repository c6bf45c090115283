"""Recordings of a machine's joints, as the absolute sensors logged them.

One CSV file per segment, gzipped or not, named after it: ``boom.csv.gz``. Columns are ``run``,
``time_s``, ``signal`` and ``angle_deg``. In each run the joint rests, the valve steps from 0 to one
signal, and the joint moves towards its far end.
"""

import hashlib
import io
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from labcrane import FloatArray, RecordingError
from labcrane.core import read_csv_text
from labcrane_dmd.model.interpolation import FULL

COLUMNS = ("run", "time_s", "signal", "angle_deg")
SUFFIXES = (".csv", ".csv.gz")

FASTEST_S, SLOWEST_S = 0.0002, 0.2
"""Sampling intervals that make sense, in seconds."""

GAP = 1.5
"""Steps between samples this many times the usual one are gaps."""

SMALLEST_RANGE_DEG = 7.0
"""A joint that moves less in all its runs was logged in rad, or not moved: 2 pi is 6.28."""


@dataclass(frozen=True, slots=True)
class JointRun:
    """One step of the valve.

    Attributes
    ----------
    number
        The run's number in its file.
    signal
        What the valve was set to, -250 to 250.
    step
        Index of the first sample with that signal.
    time, angle
        In seconds from the first sample and in rad, shape ``(n_samples,)``.
    """

    number: int
    signal: float
    step: int
    time: FloatArray
    angle: FloatArray

    @property
    def interval(self) -> float:
        """Time between two samples, in seconds."""
        return float(np.median(np.diff(self.time)))


@dataclass(frozen=True, slots=True)
class SegmentRecording:
    """All runs of one segment, and the file they come from."""

    name: str
    file: str
    sha256: str
    runs: tuple[JointRun, ...]

    def at(self, signal: float) -> list[JointRun]:
        """Return the runs at a signal."""
        return [run for run in self.runs if run.signal == signal]


def read_recordings(place: Path) -> tuple[SegmentRecording, ...]:
    """Read one file, or all in a folder, in the order of their names.

    Raises
    ------
    RecordingError
        There is none, or one is not what it should be; the message names file, run and time.
    """
    found = list(_files(place))
    if not found:
        raise RecordingError(f"{place} holds no recordings; they are files like boom.csv.gz")
    return tuple(_read(path) for path in found)


def _files(place: Path) -> Iterator[Path]:
    if place.is_dir():
        yield from sorted(path for path in place.iterdir() if path.name.endswith(SUFFIXES))
    elif place.exists():
        yield place
    else:
        raise RecordingError(f"{place} does not exist; give a file like boom.csv.gz, or its folder")


def _read(path: Path) -> SegmentRecording:
    import pandas as pd  # noqa: PLC0415 - loads for a second

    try:
        table = pd.read_csv(io.StringIO(read_csv_text(path)))
    except (OSError, ValueError) as error:
        raise RecordingError(f"{path} cannot be read as CSV: {error}") from error
    if missing := [name for name in COLUMNS if name not in table]:
        raise RecordingError(
            f"{path} has no column {', '.join(map(repr, missing))}; its columns are "
            f"{', '.join(map(str, table))}, and need to be {', '.join(COLUMNS)}, in s and degrees"
        )
    try:
        run, time, signal, angle = (table[name].to_numpy(np.float64) for name in COLUMNS)
    except (ValueError, TypeError, OverflowError) as error:  # a number of 400 digits
        raise RecordingError(f"{path} contains a value that is not a number: {error}") from error
    bad = ~np.isfinite(run + time + signal + angle)
    if bad.any():
        raise RecordingError(
            f"{path} has {int(bad.sum())} samples that are not numbers, the first in line "
            f"{int(bad.argmax()) + 2}; take the run out or record it again"
        )
    runs = tuple(
        _run(path, int(number), time[run == number], signal[run == number], angle[run == number])
        for number in dict.fromkeys(run.tolist())
    )
    _check_whole(path, runs)
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    return SegmentRecording(path.name.split(".")[0], path.name, digest, runs)


def _run(
    path: Path, number: int, time: FloatArray, signal: FloatArray, angle: FloatArray
) -> JointRun:
    where = f"{path}, run {number}"
    steps = np.diff(time)
    if not steps.size or (steps <= 0.0).any():
        first = float(time[int((steps <= 0.0).argmax())]) if steps.size else float(time[0])
        raise RecordingError(f"{where}: time does not go on after {first:g} s; it must rise")
    usual = float(np.median(steps))
    if not FASTEST_S <= usual <= SLOWEST_S:
        raise RecordingError(
            f"{where}: samples are {usual:g} s apart; time_s is in seconds, and 0.0002 to 0.2 s "
            "between samples make sense"
        )
    if (gap := int(steps.argmax())) >= 0 and steps[gap] > GAP * usual:
        raise RecordingError(
            f"{where}: {steps[gap]:.3g} s without a sample after {time[gap]:g} s, where "
            f"{usual:.3g} s are usual; record the run again"
        )
    levels = list(dict.fromkeys(signal.tolist()))
    if len(levels) > 2 or (len(levels) == 2 and levels[0] != 0.0):  # noqa: PLR2004 - rest, step
        raise RecordingError(
            f"{where}: signals are {', '.join(f'{level:g}' for level in levels[:4])}; a run rests "
            "at 0 and steps once"
        )
    if abs(levels[-1]) > FULL:
        raise RecordingError(
            f"{where}: signal {levels[-1]:g} is beyond -250 to 250, which are full flow"
        )
    step = int((signal == levels[-1]).argmax())
    return JointRun(number, levels[-1], step, time - time[0], np.radians(angle))


def _check_whole(path: Path, runs: tuple[JointRun, ...]) -> None:
    lowest = min(float(run.angle.min()) for run in runs)
    highest = max(float(run.angle.max()) for run in runs)
    span = np.degrees(highest - lowest)
    if span > 360.0:  # noqa: PLR2004 - a turn
        raise RecordingError(
            f"{path}: angles span {span:.0f} degrees, more than a turn; angle_deg is in degrees"
        )
    if span < SMALLEST_RANGE_DEG:
        raise RecordingError(
            f"{path}: the joint moves by {span:.2g} degrees in all its runs; angle_deg is in "
            "degrees, not rad, and a joint that stands still cannot be modelled"
        )
    if max(abs(run.signal) for run in runs) < FULL:
        raise RecordingError(
            f"{path}: the largest signal is {max(abs(run.signal) for run in runs):g}; a model "
            "needs recordings up to 250, which is full flow in both directions"
        )
