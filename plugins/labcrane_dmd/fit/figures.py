"""Pictures of a model: what it was fitted to, its layers, and how it does at other signals."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from labcrane_dmd.fit.fitting import LAGS, curve_at
from labcrane_dmd.fit.recordings import SegmentRecording
from labcrane_dmd.fit.validation import Level, of_segments
from labcrane_dmd.model.interpolation import FULL
from labcrane_dmd.model.model import Model, SegmentModel
from labcrane_dmd.model.output import written

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def _figure(width: float, height: float) -> "Figure":
    from matplotlib.figure import Figure  # noqa: PLC0415 - loads for a second

    return Figure(figsize=(width, height), layout="constrained")


def draw_model(model: Model, path: Path) -> None:
    """Draw speed over angle for every layer, and over the signal, into a PNG file."""
    figure = _figure(4.5 * len(model), 7.5)
    axes = figure.subplots(2, len(model), squeeze=False)
    for column, segment in enumerate(model.values()):
        _draw_layers(segment, axes[0, column])
        _draw_signals(segment, axes[1, column])
    figure.suptitle(f"between layers: {model.settings.between}")
    with written(path):
        figure.savefig(path, dpi=110)


def _draw_layers(segment: SegmentModel, axes: "Axes") -> None:
    for layer in segment.layers():
        angle = np.linspace(*layer.covers, 100)
        speed = np.degrees([layer.speed(place) for place in angle.tolist()])
        axes.plot(np.degrees(angle), speed, lw=1.3, label=f"{layer.signal:+g}")
    axes.set(title=segment.name, xlabel="angle (deg)", ylabel="speed (deg/s)")
    axes.legend(title="signal", fontsize="x-small", ncols=2)
    axes.grid(alpha=0.3)


def _draw_signals(segment: SegmentModel, axes: "Axes") -> None:
    signals = np.linspace(-FULL, FULL, 501)
    for share in (0.1, 0.5, 0.9):
        angle = segment.limits[0] + share * (segment.limits[1] - segment.limits[0])
        speed = np.degrees([segment.speed(signal, angle) for signal in signals.tolist()])
        axes.plot(signals, speed, lw=1.3, label=f"{np.degrees(angle):.0f} deg")
    axes.set(xlabel="signal (0.4 %)", ylabel="speed (deg/s)")
    axes.legend(fontsize="small")
    axes.grid(alpha=0.3)


def draw_angles(recordings: Sequence[SegmentRecording], path: Path) -> None:
    """Draw each run's angle over time, as the sensors gave it, into a PNG file."""
    figure = _figure(4.5 * len(recordings), 4.0)
    panels = figure.subplots(1, len(recordings), squeeze=False)[0]
    for axes, recording in zip(panels, recordings, strict=True):
        for run in recording.runs:
            colour = ((run.signal + FULL) / (2.0 * FULL), 0.2, (FULL - run.signal) / (2.0 * FULL))
            axes.plot(run.time, np.degrees(run.angle), lw=0.7, color=colour)
        axes.set(title=recording.name, xlabel="time (s)", ylabel="angle (deg)")
        axes.grid(alpha=0.3)
    figure.suptitle(f"angles as recorded; blue {-FULL:g} to red {FULL:g}")
    with written(path):
        figure.savefig(path, dpi=110)


def draw_speeds(model: Model, recordings: Sequence[SegmentRecording], path: Path) -> None:
    """Draw recorded speed by angle and each layer's polynomial through it, into a PNG file.

    Raises
    ------
    RecordingError
        A segment of the model was not recorded.
    """
    named = of_segments(model, recordings)
    figure = _figure(4.5 * len(model), 4.5)
    panels = figure.subplots(1, len(model), squeeze=False)[0]
    for axes, (name, segment) in zip(panels, model.items(), strict=True):
        for number, layer in enumerate(segment.layers()):
            direction = segment.direction(layer.signal)
            run_up = direction.dead_time + LAGS * direction.lag
            curve = curve_at(named[name], layer.signal, run_up)
            colour = f"C{number % 10}"
            if curve is not None:
                recorded = np.degrees(curve.angle), np.degrees(curve.speed)
                axes.plot(*recorded, ".", ms=2, color=colour)
            angle = np.linspace(*layer.covers, 100)
            speed = np.degrees([layer.speed(place) for place in angle.tolist()])
            axes.plot(np.degrees(angle), speed, lw=1.0, color=colour, label=f"{layer.signal:+g}")
        axes.set(title=name, xlabel="angle (deg)", ylabel="speed (deg/s): dots recorded")
        axes.legend(title="signal", fontsize="x-small", ncols=2)
        axes.grid(alpha=0.3)
    figure.suptitle("speed by angle, and the polynomial of each layer")
    with written(path):
        figure.savefig(path, dpi=110)


def draw_validation(levels: Sequence[Level], between: str, path: Path) -> None:
    """Draw recorded and predicted speed over angle, and their difference, into a PNG file."""
    names = list(dict.fromkeys(level.segment for level in levels))
    figure = _figure(4.5 * len(names), 7.5)
    axes = figure.subplots(2, len(names), squeeze=False)
    for column, name in enumerate(names):
        speed, error = axes[0, column], axes[1, column]
        for number, level in enumerate(level for level in levels if level.segment == name):
            colour = f"C{number % 10}"
            speed.plot(level.angle, level.recorded, ".", ms=2, color=colour)
            speed.plot(level.angle, level.predicted, lw=1, color=colour, label=f"{level.signal:+d}")
            error.plot(level.angle, level.predicted - level.recorded, lw=0.8, color=colour)
        speed.set(title=name, ylabel="speed (deg/s): dots recorded, lines model")
        error.set(xlabel="angle (deg)", ylabel="model - recorded (deg/s)")
        speed.legend(fontsize="x-small", ncols=2)
        speed.grid(alpha=0.3)
        error.grid(alpha=0.3)
    figure.suptitle(f"signals that the model has not seen; between layers: {between}")
    with written(path):
        figure.savefig(path, dpi=110)
