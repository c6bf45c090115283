"""Steps of a valve, cut out of one long log of its signal and of the joint's angle."""

import csv
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from labcrane import FloatArray, RecordingError
from labcrane_dmd.model.interpolation import FULL
from labcrane_dmd.model.output import written

REST_S = 0.5
"""Rest before a step that is part of its run."""

SHORTEST_S = 1.0
"""A signal that is held for less is not a step: the lever was moving, or was only touched."""

STILL_S = 5.0
"""A rest this long, its first second left out, is a run at 0."""

COAST_S = 1.0

SAMPLE, SIGNAL, ANGLE = ("time_s", "what", "value"), "signal", "angle_deg"


@dataclass(frozen=True, slots=True)
class Sample:
    """One value that came: of the signal, -250 to 250, or of the angle in degrees; time in s."""

    time: float
    what: str
    value: float


@dataclass(frozen=True, slots=True)
class ValveStep:
    """A stretch of one signal.

    Attributes
    ----------
    signal
        -250 to 250.
    time, signals, angle
        In seconds from the run's start, and in degrees, shape ``(n_samples,)``; of its rest, too.
    left_out
        Why it is not a run, in words; empty for a run.
    """

    signal: int
    time: FloatArray
    signals: FloatArray
    angle: FloatArray
    left_out: str = ""


def cut(samples: Iterable[Sample]) -> tuple[ValveStep, ...]:
    """Return all steps of a log, in order; the longest rest becomes a run at 0.

    A row is a sample of the angle, with the last signal before it.

    Raises
    ------
    RecordingError
        There is nothing of signal or angle, a signal is beyond full flow, or no step is a run.
    """
    time, signal, angle = _joined(sorted(samples, key=lambda sample: sample.time))
    edges = np.flatnonzero(np.diff(signal)) + 1
    starts, ends = [0, *edges.tolist()], [*edges.tolist(), len(signal)]
    steps, still = [], None
    for number, (start, end) in enumerate(zip(starts, ends, strict=True)):
        level = round(float(signal[start]))
        lasts = float(time[end - 1] - time[start])
        if level == 0:
            first = start + int(np.searchsorted(time[start:end] - time[start], COAST_S))
            longest = still is None or lasts > still.time[-1] + COAST_S
            if lasts >= STILL_S and longest:
                still = _step(0, slice(first, end), time, signal, angle)
            continue
        rested = number > 0 and signal[starts[number - 1]] == 0.0
        rest = float(time[start] - time[starts[number - 1]]) if rested else 0.0
        first = start
        if rested:
            before = time[:start] >= time[start] - REST_S - 1e-9
            first = max(starts[number - 1], int(before.argmax()))
        why = _why_not(level, lasts, rest)
        steps.append(_step(level, slice(first, end), time, signal, angle, why))
    runs = [step for step in steps if not step.left_out]
    if not runs:
        said = "; ".join(dict.fromkeys(step.left_out for step in steps)) or "the signal stays at 0"
        raise RecordingError(
            f"no step of the log is a run: {said}; rest at 0 for {REST_S:g} s, step to one signal, "
            "and hold it until the joint is at its end"
        )
    return (*steps, still) if still is not None else tuple(steps)


def _joined(samples: Sequence[Sample]) -> tuple[FloatArray, FloatArray, FloatArray]:
    rows, signal = [], None
    for sample in samples:
        if sample.what == SIGNAL:
            if not abs(sample.value) < FULL + 0.5:  # it is rounded; NaN is refused, too
                raise RecordingError(
                    f"the signal is {sample.value:g} at {sample.time:g} s, beyond -250 to 250, "
                    "which are full flow; see what full flow is in its source (--full)"
                )
            signal = float(round(sample.value))
        elif signal is not None:
            rows.append((sample.time, signal, sample.value))
    if not rows:
        count = {what: sum(s.what == what for s in samples) for what in (SIGNAL, ANGLE)}
        raise RecordingError(
            f"{count[SIGNAL]} values of the signal and {count[ANGLE]} of the angle came, and no "
            "angle after a signal; see what --signal and --angle name"
        )
    time, signals, angle = (np.array(column) for column in zip(*rows, strict=True))
    return time, signals, angle


def _step(
    level: int,
    part: slice,
    time: FloatArray,
    signal: FloatArray,
    angle: FloatArray,
    why: str = "",
) -> ValveStep:
    return ValveStep(level, time[part] - time[part.start], signal[part], angle[part], why)


def _why_not(level: int, lasts: float, rest: float) -> str:
    if lasts < SHORTEST_S:
        return f"signal {level} was held for {lasts:.2g} s only"
    if rest < 0.9 * REST_S:
        return f"before signal {level} the valve rested for {rest:.2g} s only"
    return ""


def write_runs(steps: Sequence[ValveStep], folder: Path, segment: str) -> Path:
    """Write the runs into ``SEGMENT.csv``, and all steps into ``steps/SEGMENT.csv``.

    Raises
    ------
    RecordingError
        They cannot be written.
    """
    path, table = folder / f"{segment}.csv", folder / "steps" / f"{segment}.csv"
    runs = sorted((step for step in steps if not step.left_out), key=lambda step: step.signal)
    numbers = {id(step): number for number, step in enumerate(runs)}
    with written(table):
        table.parent.mkdir(parents=True, exist_ok=True)
        with table.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(("run", "signal", "seconds", "from_deg", "to_deg", "left_out"))
            for step in steps:
                ends = (f"{step.angle[0]:.4f}", f"{step.angle[-1]:.4f}")
                number = numbers.get(id(step), "")
                lasts = f"{step.time[-1]:.3f}"
                writer.writerow((number, step.signal, lasts, *ends, step.left_out))
    with written(path), path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(("run", "time_s", SIGNAL, ANGLE))
        for number, step in enumerate(runs):
            for time, signal, angle in zip(step.time, step.signals, step.angle, strict=True):
                writer.writerow((number, f"{time:.6f}", f"{signal:g}", f"{angle:.6f}"))
    return path
