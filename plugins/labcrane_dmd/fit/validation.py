"""Validation of a model at signals that it was not fitted to."""

import csv
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from labcrane import FloatArray, RecordingError
from labcrane_dmd.fit.fitting import LAGS, curve_at
from labcrane_dmd.fit.recordings import SegmentRecording
from labcrane_dmd.model.model import Model, SegmentModel
from labcrane_dmd.model.output import written


@dataclass(frozen=True, slots=True)
class Level:
    """One segment at one signal; speeds in deg/s, angles in degrees.

    Attributes
    ----------
    angle, recorded, predicted
        Speed curves over the angles that the recording and the layers around the signal cover,
        shape ``(n_points,)``; empty where the joint stood still.
    """

    segment: str
    signal: int
    angle: FloatArray
    recorded: FloatArray
    predicted: FloatArray

    @property
    def direction(self) -> str:
        """``extend`` for positive signals, ``retract`` for negative ones, ``none`` for 0."""
        return "extend" if self.signal > 0 else "retract" if self.signal < 0 else "none"

    def row(self) -> dict[str, str | float]:
        """Return the level's line of the table.

        The first columns are the paper's: errors are of the model's speed at every half degree.
        """
        errors = self.predicted - self.recorded
        mean, model = float(self.recorded.mean()), float(self.predicted.mean())
        return {
            "segment": self.segment,
            "direction": self.direction,
            "signal": self.signal,
            "mean_speed": mean,
            "mse": float(np.mean(errors**2)),
            "rmse": float(np.sqrt(np.mean(errors**2))),
            "mae": float(np.mean(np.abs(errors))),
            "max_abs_error": float(np.abs(errors).max()),
            "residual_variance": float(errors.var()),
            "model_mean_speed": model,
            "mean_error": model - mean,
            "mean_error_percent": 100.0 * (model - mean) / mean if mean else 0.0,
            "from_deg": float(self.angle[0]),
            "to_deg": float(self.angle[-1]),
        }


def of_segments(
    model: Model, recordings: Sequence[SegmentRecording]
) -> dict[str, SegmentRecording]:
    """Return recordings by their segments; raise :class:`RecordingError` where one is missing."""
    named = {recording.name: recording for recording in recordings}
    if missing := [name for name in model if name not in named]:
        raise RecordingError(
            f"there is no recording of {', '.join(missing)}, which the model has; there are "
            f"recordings of {', '.join(named)}"
        )
    return named


def validate(model: Model, recordings: Sequence[SegmentRecording]) -> tuple[Level, ...]:
    """Compare a model with the recordings at its validation signals, in both directions and at 0.

    Raises
    ------
    RecordingError
        A recording of a segment, or one of the signals, is missing.
    """
    named = of_segments(model, recordings)
    return tuple(level for name in model for level in _levels(model, model[name], named[name]))


def _levels(model: Model, segment: SegmentModel, recording: SegmentRecording) -> Iterator[Level]:
    for signal in validation_signals(model, recording):
        yield _level(segment, recording, signal)


def validation_signals(model: Model, recording: SegmentRecording) -> tuple[int, ...]:
    """Return the signals at which a segment is validated, rising; 0 is among them (Typiak 2024).

    Raises
    ------
    RecordingError
        There is no run at one of them.
    """
    sizes = sorted(model.settings.validation)
    signals = (*(-size for size in reversed(sizes)), 0, *sizes)
    for signal in signals:
        if not recording.at(signal):
            raise RecordingError(
                f"{recording.file} has no run at signal {signal}, at which the model is validated; "
                "record it"
            )
    return signals


def _level(segment: SegmentModel, recording: SegmentRecording, signal: int) -> Level:
    direction = segment.direction(signal)
    curve = curve_at(recording, signal, direction.dead_time + LAGS * direction.lag)
    if curve is None:  # the joint did not move: the model should predict this everywhere
        angle = np.linspace(*segment.limits, 20)
        recorded = np.zeros_like(angle)
    else:
        weaker = [layer for layer in direction.layers if abs(layer.signal) < abs(signal)][-1:]
        stronger = [layer for layer in direction.layers if abs(layer.signal) >= abs(signal)][:1]
        around = [layer.covers for layer in (*weaker, *stronger)]
        lowest = max(covers[0] for covers in around)
        highest = min(covers[1] for covers in around)
        shared = (curve.angle >= lowest) & (curve.angle <= highest)
        shared = shared if shared.any() else np.ones_like(shared)
        angle, recorded = curve.angle[shared], curve.speed[shared]
    predicted = np.array([segment.speed(signal, place) for place in angle.tolist()])
    return Level(
        segment.name, signal, np.degrees(angle), np.degrees(recorded), np.degrees(predicted)
    )


def write_table(rows: Iterable[dict[str, str | float]], path: Path) -> None:
    """Write rows of levels as CSV."""
    lines = list(rows)
    with written(path), path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(lines[0]))
        writer.writeheader()
        for line in lines:
            writer.writerow({key: _cell(value) for key, value in line.items()})


def _cell(value: str | float) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def summary(levels: Sequence[Level]) -> list[dict[str, str | float]]:
    """Return each segment's averages over its levels and directions: the paper's third table."""
    rows: list[dict[str, str | float]] = []
    for segment in dict.fromkeys(level.segment for level in levels):
        mine = [level.row() for level in levels if level.segment == segment]
        names = ("mse", "rmse", "mae", "max_abs_error", "residual_variance")
        means = {name: float(np.mean([float(row[name]) for row in mine])) for name in names}
        largest = max(float(row["max_abs_error"]) for row in mine)
        rows.append({"segment": segment, **means, "largest_error": largest})
    return rows
