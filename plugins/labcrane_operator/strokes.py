"""The main stroke of every recorded movement, to which the operator's model is fitted.

A movement's time has reaction, looks and corrections in it, and the end rule cuts off errors: so
the part around the largest speed is fitted.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from labcrane import FloatArray, RecordingError, open_recording
from labcrane.analysis import movements_of, presentation_failed
from labcrane.recording import attempt_of

if TYPE_CHECKING:
    from labcrane.analysis import Movement
    from labcrane.recording import SessionRecord

NEEDED = ("command_onset", "width", "target_x", "target_y", "target_z")
"""Columns of the trial table without which there is no stroke."""

SLOW = 0.05
"""Proportion of the peak speed below which a stroke has not begun, or has ended."""

MAIN = 0.5
"""Minimum proportion of the distance to the target that a main stroke covers: other strokes only
correct."""

LATE_TICKS = 1.5
"""Ticks by which a simulated operator's first command is later than its reaction time: one to see
the target, half of one to the next tick; its stroke then begins with a speed of 0."""


@dataclass(frozen=True, slots=True)
class Strokes:
    """Main strokes, one per element.

    Attributes
    ----------
    trial
        Number of the trial in its session, from 1, approaches included; shape ``(n,)``.
    reaction
        Time from seeing the target to the first command in s, shape ``(n,)``; NaN without one.
    distance, width
        From the tip to the target's centre as the stroke begins, and the target's diameter, in m,
        shape ``(n,)``.
    duration
        Of the movement of least jerk that the stroke is closest to, in s, shape ``(n,)``.
    miss
        From the target's centre to where the stroke ended, as a fraction of its length, along the
        way and across it in two directions; shape ``(n, 3)``.
    """

    trial: FloatArray
    reaction: FloatArray
    distance: FloatArray
    width: FloatArray
    duration: FloatArray
    miss: FloatArray

    def __len__(self) -> int:
        return len(self.trial)


def read_strokes(path: Path, number: int) -> Strokes:
    """Read the main strokes of a session's counted movements; those without one are left out.

    So are those in which the operator was shown too little.

    Raises
    ------
    RecordingError
        There is no such session, it has no counted movements, or they are not aimed ones.
    """
    session = open_recording(path).session(number)
    _check(session, f"session {number} of {path}")
    found = list(_strokes(session))
    rows = np.array(found, dtype=float).reshape(-1, 8)
    trial, reaction, distance, width, duration = rows[:, :5].T
    return Strokes(trial, reaction, distance, width, duration, miss=rows[:, 5:])


def _check(session: "SessionRecord", where: str) -> None:
    trials = session.trials
    if trials.empty:
        raise RecordingError(
            f"{where} has no counted movements, and an operator is fitted to those; choose another "
            "session with --session"
        )
    if missing := [name for name in NEEDED if name not in trials]:
        raise RecordingError(
            f"{where} has no {', '.join(missing)} in its trials, so it is not of the task "
            "'aiming'; an operator can be fitted to aimed movements only"
        )


def _strokes(session: "SessionRecord") -> Iterator[tuple[float, ...]]:
    failed = presentation_failed(session)
    for movement in movements_of(session):
        if failed.get(attempt_of(movement.row)):
            continue  # the operator was shown too little of it
        stroke = main_stroke(movement)
        if stroke is not None:
            yield stroke


def main_stroke(movement: "Movement") -> tuple[float, ...] | None:
    """Return trial, reaction, distance, width, duration and the three misses; None without one."""
    target, width = movement.point("target"), movement.result("width")
    found = _span(movement.speed)
    if found is None:
        return None
    first, last = found
    start, end = movement.tip[0], movement.tip[last]  # before the main stroke the tip is at rest
    way = target - start
    distance = float(np.linalg.norm(way))
    along = way / distance
    progress = (movement.tip[first : last + 1] - start) @ along
    if progress[-1] - progress[0] < MAIN * distance:
        return None
    duration = least_jerk_duration(movement.elapsed[first : last + 1], progress)
    across = np.cross(along, (0.0, 0.0, 1.0))
    across /= np.linalg.norm(across)
    sides = (along, across, np.cross(along, across))
    miss = [float((end - target) @ side) / distance for side in sides]
    reaction = movement.result("command_onset") - LATE_TICKS / movement.rate_hz
    return movement.result("trial"), reaction, distance, width, duration, *miss


def _span(speed: FloatArray) -> tuple[int, int] | None:
    """Return the first and last tick of the stroke about the largest speed."""
    if speed.size == 0 or not speed.max() > 0.0:
        return None
    peak = int(speed.argmax())
    slow = np.flatnonzero(speed <= SLOW * speed[peak])
    before, after = slow[slow < peak], slow[slow > peak]
    if not after.size:
        return None
    return (int(before[-1]) if before.size else 0), int(after[0])


def least_jerk_duration(time: FloatArray, progress: FloatArray) -> float:
    """Return the duration in s of the movement of least jerk that is closest to the progress.

    When and where it begins and its length are fitted as well: slow ticks at both ends may be
    missing.

    Parameters
    ----------
    time, progress
        In s and m, shape ``(n,)``.
    """
    from scipy.optimize import least_squares  # noqa: PLC0415 - loaded when it is used

    def off(found: FloatArray) -> FloatArray:
        start, duration, length, before = found
        u = np.clip((time - start) / duration, 0.0, 1.0)
        away: FloatArray = before + length * u**3 * (10.0 + u * (6.0 * u - 15.0)) - progress
        return away

    seen = float(time[-1] - time[0])
    guess = (float(time[0]) - 0.06 * seen, 1.13 * seen, float(progress[-1]), 0.0)
    scale = (seen, seen, abs(guess[2]), abs(guess[2]))
    return float(least_squares(off, guess, x_scale=scale).x[1])
