"""Speed over angle from a log of angles."""

from dataclasses import dataclass

import numpy as np

from labcrane import FloatArray
from labcrane_dmd.fit.recordings import JointRun

STILL_RAD = float(np.radians(0.5))
"""A joint that moves less in a run has not moved: 25 times the sensor's noise."""

WINDOW_RAD = float(np.radians(3.0))
"""Angle over which speed is taken as a slope: the noise of the sensor averages out, and the lever
geometry does not yet bend."""

SHORTEST, LONGEST = 15, 1001
"""Bounds of that window in samples."""

BIN_RAD = float(np.radians(0.5))
"""Angle that becomes one point of a speed curve, so that slow stretches do not weigh more."""

FEWEST_POINTS = 3


@dataclass(frozen=True, slots=True)
class SpeedCurve:
    """Speed over angle of one run: angles in rad, rising, and speeds in rad/s, same shape."""

    angle: FloatArray
    speed: FloatArray

    @property
    def covers(self) -> tuple[float, float]:
        """Lowest and highest angle, in rad."""
        return float(self.angle[0]), float(self.angle[-1])


def moved(run: JointRun) -> float:
    """Return how far the joint came in a run, in rad, with sign."""
    return float(np.median(run.angle[-5:]) - np.median(run.angle[: max(run.step, 5)]))


def moves(run: JointRun) -> bool:
    """Whether the joint moved at all."""
    return abs(moved(run)) >= STILL_RAD


def speed_curve(run: JointRun, run_up_s: float) -> SpeedCurve | None:
    """Return the speed curve of a run; None when the joint hardly moves after the run-up.

    The first ``run_up_s`` seconds after the step are cut (dead time, and the valve's opening), and
    so is what the joint stands at its far end. Speed is the slope of a line through the samples
    of a sliding window, which is also a parabola's slope in its middle.
    """
    if not moves(run):
        return None
    first = run.step + int(np.ceil(run_up_s / run.interval))
    last = _arrival(run)
    angle, time = run.angle[first:last], run.time[first:last]
    if len(angle) < SHORTEST + FEWEST_POINTS or abs(angle[-1] - angle[0]) < STILL_RAD:
        return None
    pace = abs(angle[-1] - angle[0]) / (time[-1] - time[0])
    half = int(np.clip(WINDOW_RAD / pace / run.interval, SHORTEST, LONGEST)) // 2
    half = min(half, (len(angle) - FEWEST_POINTS) // 2)
    offsets = np.arange(-half, half + 1)
    weights = offsets / (offsets @ offsets) / run.interval
    speed = np.correlate(angle, weights, mode="valid")
    middle = np.correlate(angle, np.full(2 * half + 1, 1.0 / (2 * half + 1)), mode="valid")
    return _binned(middle, speed)


def _arrival(run: JointRun) -> int:
    """Return the index behind the last sample in which the joint still moves."""
    end = np.median(run.angle[-5:])
    away = np.flatnonzero(np.abs(run.angle - end) > STILL_RAD / 2)
    near = int(away[-1]) + 1 if away.size else 0
    rest = len(run.angle) - near
    return near if rest * run.interval > 1.0 and _stands(run.angle[near:]) else len(run.angle)


def _stands(angle: FloatArray) -> bool:
    half = len(angle) // 2
    return bool(abs(np.mean(angle[half:]) - np.mean(angle[:half])) < STILL_RAD / 20)


def _binned(angle: FloatArray, speed: FloatArray) -> SpeedCurve | None:
    bins = np.floor(angle / BIN_RAD).astype(int)
    places, which = np.unique(bins, return_inverse=True)
    if len(places) < FEWEST_POINTS:
        return None
    count = np.bincount(which)
    return SpeedCurve(np.bincount(which, angle) / count, np.bincount(which, speed) / count)
