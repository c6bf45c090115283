"""Fit of a model to recordings."""

from collections.abc import Sequence
from dataclasses import replace
from importlib.metadata import version

import numpy as np

from labcrane import RecordingError
from labcrane_dmd.fit.polynomial import fit
from labcrane_dmd.fit.recordings import JointRun, SegmentRecording
from labcrane_dmd.fit.speeds import SpeedCurve, moves, speed_curve
from labcrane_dmd.fit.step_response import identify
from labcrane_dmd.model.interpolation import Layer
from labcrane_dmd.model.model import Direction, Model, SegmentModel, Source
from labcrane_dmd.model.settings import FitSettings

FIRST_RUN_UP_S = 0.8
"""Cut in the first pass, before dead time and lag are known."""

LAGS = 6.0
"""Length of the run-up in lags; after it, 0.25 % of the speed is missing."""

WHOLE = 0.8
"""A layer that covers this share of the joint's range, or more, lacks only its run-up."""

PASSES = 8
"""At most: layers need the run-up, which needs the layers. Two or three are enough."""

NEAR = 6
"""Points of a curve, 3 degrees, whose ratio to a weaker one's holds where it was not measured."""

PARABOLA = 3


def fit_model(recordings: Sequence[SegmentRecording], settings: FitSettings) -> Model:
    """Fit every segment; the validation signals are not looked at.

    Raises
    ------
    RecordingError
        A signal or a direction is missing, or the joint stands still where it should move.
    """
    return Model(
        segments={each.name: fit_segment(each, settings) for each in recordings},
        sources={each.name: Source(each.file, each.sha256) for each in recordings},
        settings=settings,
        labcrane=version("labcrane"),
    )


def fit_segment(recording: SegmentRecording, settings: FitSettings) -> SegmentModel:
    """Fit one segment in both directions."""
    known = {*settings.levels, *settings.edge} - set(settings.validation)
    runs = tuple(run for run in recording.runs if abs(run.signal) in known)
    seen = replace(recording, runs=runs)
    for direction, sign in (("positive", 1), ("negative", -1)):
        if not any(run.signal * sign > 0 for run in runs):
            raise RecordingError(
                f"{recording.file} has no runs with {direction} signals; a model needs both "
                "directions"
            )
    limits = (
        min(float(np.median(run.angle[-5:])) for run in runs),
        max(float(np.median(run.angle[-5:])) for run in runs),
    )
    return SegmentModel(
        recording.name,
        limits,
        extend=_direction(seen, 1, limits, settings),
        retract=_direction(seen, -1, limits, settings),
        between=settings.between,
    )


def _direction(
    recording: SegmentRecording, sign: int, limits: tuple[float, float], settings: FitSettings
) -> Direction:
    signals = [sign * level for level in sorted(settings.levels)]
    _check(recording, signals)
    found_band = settings.dead_band == "found"
    dead_band = _dead_band(recording, sign, settings) if found_band else 0.0
    layers = _layers(recording, signals, limits, FIRST_RUN_UP_S, settings)
    far = [layer.signal for layer in layers if layer.whole] or signals[-1:]
    first = [run for signal in far for run in recording.at(signal)]
    found = Direction(dead_band, 0.0, 0.0, layers)
    delays = identify(found, first, settings.between)
    for _ in range(PASSES):
        before, (dead_time, lag) = delays, delays
        layers = _layers(recording, signals, limits, dead_time + LAGS * lag, settings)
        found = Direction(dead_band, dead_time, lag, layers)
        delays = identify(found, first, settings.between, around=before)
        if delays == before:
            break
    return found


def _check(recording: SegmentRecording, signals: Sequence[int]) -> None:
    stood: JointRun | None = None
    for signal in reversed(signals):  # from the strongest: only the weakest may not move the joint
        runs = recording.at(signal)
        if not runs:
            there = ", ".join(f"{run.signal:g}" for run in recording.runs)
            raise RecordingError(
                f"{recording.file} has no run at signal {signal}, which the model needs; of its "
                f"signals it has {there}"
            )
        for run in runs:
            if moves(run) and stood is not None:
                raise RecordingError(
                    f"{recording.file}, run {stood.number}: the angle does not change at signal "
                    f"{stood.signal:g}, though it does at {signal}; the sensor or the valve stood "
                    "still, so record the run again"
                )
            if moves(run) and (run.angle[-1] - run.angle[0]) * signal < 0:
                raise RecordingError(
                    f"{recording.file}, run {run.number}: the angle goes against signal {signal}; "
                    "turn the sensor's sign round, positive signals extend"
                )
            stood = stood if moves(run) else run
    if stood is not None and stood.signal == signals[-1]:
        raise RecordingError(
            f"{recording.file}, run {stood.number}: the angle does not change at full flow, signal "
            f"{stood.signal:g}; a joint that stands still cannot be modelled"
        )


def _layers(
    recording: SegmentRecording,
    signals: Sequence[int],
    limits: tuple[float, float],
    run_up_s: float,
    settings: FitSettings,
) -> tuple[Layer, ...]:
    found: list[Layer] = []
    weaker: SpeedCurve | None = None
    for signal in signals:
        curve = _measured(recording, signal, run_up_s)
        if curve is None:
            found.append(Layer(signal, limits, whole=False, coefficients=()))
            continue
        curve = curve if weaker is None else _set_off(curve, weaker, signal)
        lowest, highest = curve.covers
        whole = highest - lowest >= WHOLE * (limits[1] - limits[0])
        polynomial = fit(curve, settings.max_degree).coefficients
        found.append(Layer(signal, curve.covers, whole, polynomial))
        weaker = curve
    return tuple(found)


def _measured(recording: SegmentRecording, signal: int, run_up_s: float) -> SpeedCurve | None:
    curve = curve_at(recording, signal, run_up_s)
    if curve is None and any(moves(run) for run in recording.at(signal)):
        raise RecordingError(
            f"{recording.file}: after a run-up of {run_up_s:.2g} s too little of the run at "
            f"signal {signal} is left to fit a speed; record it from further away"
        )
    return curve


def _set_off(curve: SpeedCurve, weaker: SpeedCurve, signal: int) -> SpeedCurve:
    """Return a curve that begins where a weaker signal's does, with that one's shape.

    The stronger the signal, the more degrees go by while the valve opens. Held there, the last
    speed is wrong by as much as the lever geometry changes, and so are dead time and lag.
    """
    lowest, highest = curve.covers
    before = weaker.angle < lowest if signal > 0 else weaker.angle > highest
    if not before.any():
        return curve
    near = slice(None, NEAR) if signal > 0 else slice(-NEAR, None)
    theirs = np.interp(curve.angle[near], weaker.angle, weaker.speed)
    ratio = float(curve.speed[near] @ theirs / (theirs @ theirs))
    angle = np.concatenate([curve.angle, weaker.angle[before]])
    speed = np.concatenate([curve.speed, ratio * weaker.speed[before]])
    order = np.argsort(angle, kind="stable")
    return SpeedCurve(angle[order], speed[order])


def curve_at(recording: SegmentRecording, signal: float, run_up_s: float) -> SpeedCurve | None:
    """Return the speed curve of all runs at a signal together; None when the joint stood still."""
    found = [speed_curve(run, run_up_s) for run in recording.at(signal)]
    curves = [curve for curve in found if curve is not None]
    if not curves:
        return None
    angle = np.concatenate([curve.angle for curve in curves])
    speed = np.concatenate([curve.speed for curve in curves])
    order = np.argsort(angle, kind="stable")
    return SpeedCurve(angle[order], speed[order])


def _dead_band(recording: SegmentRecording, sign: int, settings: FitSettings) -> float:
    """Return the signal at which the joint begins to move: where the speed's parabola is zero."""
    sizes = sorted({*settings.edge, *settings.levels})
    stood, curves = 0.0, {}
    for size in sizes:
        runs = recording.at(sign * size)
        if runs and not any(moves(run) for run in runs):
            stood = float(size)
        elif (curve := curve_at(recording, sign * size, FIRST_RUN_UP_S)) is not None:
            curves[float(size)] = curve
        if len(curves) == PARABOLA:
            break
    signals = np.array(list(curves))
    speeds = np.array(_shared_means(list(curves.values())))
    roots = _roots(signals, sign * speeds)
    inside = [root for root in roots if stood <= root <= signals[0]]
    return round(max(inside, default=0.5 * (stood + float(signals[0]))), 2)


def _roots(signals: np.ndarray, speeds: np.ndarray) -> list[float]:
    degree = min(len(signals) - 1, PARABOLA - 1)
    for order in range(degree, 0, -1):
        found = np.roots(np.polyfit(signals[: order + 1], speeds[: order + 1], order))
        real = [float(root.real) for root in found if abs(root.imag) < 1e-9]  # noqa: PLR2004
        if real:
            return real
    return []


def _shared_means(curves: Sequence[SpeedCurve]) -> list[float]:
    """Return mean speeds over the angles that all curves cover, or over all if there are none."""
    lowest = max(curve.covers[0] for curve in curves)
    highest = min(curve.covers[1] for curve in curves)
    means = []
    for curve in curves:
        inside = (curve.angle >= lowest) & (curve.angle <= highest)
        means.append(float(curve.speed[inside if inside.any() else slice(None)].mean()))
    return means
