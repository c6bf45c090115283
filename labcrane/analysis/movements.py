"""One movement's arrays, cut out of a session."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from labcrane.analysis.kinematics.onset import ROUNDING_S, onset, reaction
from labcrane.files.yaml import parse_yaml
from labcrane.machines.machine import Machine
from labcrane.recording.participant_file.reader import SessionRecord
from labcrane.types import FloatArray

if TYPE_CHECKING:
    import pandas as pd

Groups = Mapping[str, "pd.DataFrame"]
"""The columns of loop, input, command and state, one row per tick."""

TICKS = 1 << 16
"""Ticks of a session that are in memory at a time; more if one trial has more."""

USED: Mapping[str, tuple[str, ...]] = {
    "loop": ("due", "trial", "paused", "elapsed"),
    "input": (),
    "command": ("command",),
    "state": ("tip.position", "tip.velocity", "joint.angle"),
}
"""Signals that a movement has, by group; all of them where none is named."""


@dataclass(frozen=True)
class Movement:
    """One attempt at one trial, tick by tick, pauses left out.

    Attributes
    ----------
    row
        Its row of the trial table: condition and results.
    rate_hz
        Ticks per second.
    due
        On the run's clock, in seconds, shape ``(n,)``.
    elapsed
        Since the trial's start, in seconds, shape ``(n,)``.
    tip, velocity
        Of the end effector in m and m/s, shape ``(n, 3)``.
    axes
        By name, ``left.x``; each of shape ``(n,)``, in [-1, 1].
    command, angles
        Joint speeds asked for in rad/s and joint angles in rad, shape ``(n, n_joints)``.
    remeasured
        Whether the recording used a former rule for onset and times, and ``row`` uses the present:
        :func:`by_todays_rule`.
    """

    row: Mapping[str, Any]
    rate_hz: float
    due: FloatArray
    elapsed: FloatArray
    tip: FloatArray
    velocity: FloatArray
    axes: Mapping[str, FloatArray]
    command: FloatArray
    angles: FloatArray
    remeasured: bool = False

    @cached_property
    def speed(self) -> FloatArray:
        """Speed of the tip in m/s, shape ``(n,)``."""
        speed: FloatArray = np.linalg.norm(self.velocity, axis=1)
        return speed

    @cached_property
    def span(self) -> slice | None:
        """The ticks from onset to offset, both included; None when one of them is missing.

        For a task without errors, which has no aim, a movement begins with the reaction.
        """
        aimed = not np.isnan(self.result("error_along"))
        onset = self.result("movement_onset" if aimed else "reaction_time")
        duration = self.result("movement_time")
        if np.isnan(onset) or np.isnan(duration):
            return None
        first = int(np.searchsorted(self.elapsed, onset - ROUNDING_S))
        last = int(np.searchsorted(self.elapsed, onset + duration - ROUNDING_S))
        return slice(first, last + 1)

    @property
    def pauses(self) -> list[tuple[float, float]]:
        """When it was paused and when it went on, on the run's clock, in seconds.

        The run's clock continues in a pause, and the trial's does not.
        """
        tick = 1.0 / self.rate_hz
        more = np.diff(self.due) - np.diff(self.elapsed)
        at = np.flatnonzero(more > tick / 2.0)
        return [(float(self.due[i] + tick), float(self.due[i + 1])) for i in at]

    def result(self, name: str) -> float:
        """Return a number of the trial table, in s, m or what its column is in; NaN for none."""
        value = self.row.get(name, np.nan)
        return float(value) if isinstance(value, int | float) else np.nan

    def point(self, name: str) -> FloatArray:
        """Return a point of the condition, ``start`` or ``target``, in m, shape ``(3,)``."""
        return np.array([self.result(f"{name}_{axis}") for axis in "xyz"])


def groups(
    session: SessionRecord, start: int = 0, stop: int | None = None
) -> dict[str, "pd.DataFrame"]:
    """Read what movements are cut out of in some of a session's ticks, and nothing else."""
    import pandas as pd

    found = {}
    for group, wanted in USED.items():
        stream = session.streams[group]
        names = [name for name in stream.units if not wanted or _is_of(name, wanted)]
        found[group] = pd.DataFrame(stream.columns(names, start, stop), copy=False)
    return found


def machine_of(session: SessionRecord) -> Machine:
    """Return the machine that was operated."""
    text = session.context["machine"]
    written = parse_yaml(text, "the recorded machine", recorded=True)
    return Machine.model_validate(written, context={"recorded": True})


def movements_of(session: SessionRecord) -> Iterator[Movement]:
    """Yield the movement of each row of a session's trial table.

    Aimed ones have their onset by today's rule (:func:`by_todays_rule`). However long the session,
    so many ticks are in memory as the longest trial has, or :data:`TICKS`.
    """
    trials, rate_hz = session.trials, float(session.attrs["rate_hz"])
    if trials.empty:  # of a session that ended before its first result, without columns
        return
    first, last = _ticks_of(session, trials)
    at = 0
    while at < len(trials):
        begin, after = first[at], at + 1
        while after < len(trials) and begin <= first[after] and last[after] <= begin + TICKS:
            after += 1
        # Trials in one piece of the file: each piece is unpacked but once or twice.
        frames = groups(session, begin, int(last[at:after].max()))
        for movement in cut(frames, trials.iloc[at:after], rate_hz):
            yield by_todays_rule(movement, session)
        at = after


DEFINES = ("movement_onset", "onset_speed", "onset_hold")
"""Results of an aimed movement that a recording by a former rule has not."""

ANEW = ("reaction_time", *DEFINES, "movement_time", "onset_to_rest", "path_length")
"""Columns of the trial table that are by today's rule in :attr:`Movement.row`."""

ONSET_SPEED, ONSET_HOLD_S = 0.02, 0.1
"""In m/s and s: of an aimed movement whose recording does not say by what it was judged."""


def by_todays_rule(movement: Movement, session: SessionRecord) -> Movement:
    """Return an aimed movement with its onset, and what follows from it, by today's rule.

    Until version 0.1 the onset was searched back from the peak of speed, by a share of it, and all
    strokes before a halt were left out; ``reaction_time`` was the time to that onset. Those
    recordings lack :data:`DEFINES`. The offset, the commands and the speed are as recorded.
    """
    row = movement.row
    aimed = not np.isnan(movement.result("error_along"))
    if not aimed or not np.isnan(movement.result("onset_speed")):
        return movement
    threshold, hold_s = _judged_by(session)
    former = movement.result("reaction_time")
    found = onset(
        movement.elapsed,
        movement.speed,
        np.linalg.norm(movement.tip - movement.point("target"), axis=1),
        threshold=threshold,
        hold_s=hold_s,
        nearer=movement.result("width") / 2.0,
    )
    # Without an onset by the former rule the recording does not say when the movement ended.
    began = float(movement.elapsed[found]) if found is not None and not np.isnan(former) else np.nan
    again = {
        "reaction_time": reaction(movement.elapsed, movement.command),
        "movement_onset": began,
        "onset_speed": threshold,
        "onset_hold": hold_s,
        "movement_time": former + movement.result("movement_time") - began,
    }
    if "onset_to_rest" in row:
        again["onset_to_rest"] = former + movement.result("onset_to_rest") - began
    if "path_length" in row:
        ended = former + movement.result("movement_time")
        first = 0 if np.isnan(began) else found
        last = None if np.isnan(ended) else np.searchsorted(movement.elapsed, ended - ROUNDING_S)
        path = movement.tip[first : None if last is None else last + 1]
        again["path_length"] = float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
    return replace(movement, row={**row, **again}, remeasured=True)


def events_of(session: SessionRecord) -> "pd.DataFrame":
    """Return a session's events, with the onsets of its counted movements by today's rule.

    Of a recording by a former rule, ``movement.onset`` is at the former onset; here it is at
    :func:`by_todays_rule`'s, and its data say so: ``measured_anew``. Other recordings' events are
    as recorded.
    """
    events, trials = session.events, session.trials
    if "error_along" not in trials or "onset_speed" in trials:
        return events
    onsets = (events["name"] == "movement.onset").to_numpy()
    time, data = events["time"].to_numpy(np.float64).copy(), list(events["data"])
    for movement in movements_of(session):
        began = movement.result("movement_onset")
        if not movement.remeasured or np.isnan(began):
            continue
        within = (time >= movement.due[0] - ROUNDING_S) & (time <= movement.due[-1] + ROUNDING_S)
        for at in np.flatnonzero(onsets & within):
            time[at] = movement.due[np.searchsorted(movement.elapsed, began - ROUNDING_S)]
            data[at] = {**data[at], "measured_anew": True}
    return events.assign(time=time, data=data)


def _judged_by(session: SessionRecord) -> tuple[float, float]:
    """Return by which speed and for how long it judged an onset, in m/s and s.

    Of several tasks by the highest speed: it is above the noise of the machine for all of them.
    """
    settings = [part.get("settings", {}) for part in session.context.get("components", {}).values()]
    told = [
        (float(each["onset_speed"]), float(each["onset_hold_s"]))
        for each in settings
        if "onset_speed" in each and "onset_hold_s" in each
    ]
    return max(told, default=(ONSET_SPEED, ONSET_HOLD_S))


def _ticks_of(
    session: SessionRecord, trials: "pd.DataFrame"
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """Return the first tick of each trial, and the one after its last, counted from 0."""
    edges = _edges(trials)
    found = np.zeros(edges.shape, np.intp)
    loop = session.streams["loop"]
    for at in range(0, len(loop), TICKS):
        found += np.searchsorted(loop.column("due", at, at + TICKS), edges)
    return found[0], found[1]


def _edges(trials: "pd.DataFrame") -> FloatArray:
    """Return when trials began and ended, shape ``(2, n_trials)``."""
    edges = _array(trials, ["started", "ended"]).T
    wide: FloatArray = edges + np.array([[-ROUNDING_S], [ROUNDING_S]])
    return wide


def cut(frames: Groups, trials: "pd.DataFrame", rate_hz: float) -> Iterator[Movement]:
    """Yield the movement of each row of the trial table."""
    loop, state = frames["loop"], frames["state"]
    # Taken apart once: a hundred thousand rows cut out of tables, trial by trial, take long.
    due, trial, elapsed = (_array(loop, [name])[:, 0] for name in ("due", "trial", "elapsed"))
    running = _array(loop, ["paused"])[:, 0] == 0.0
    tip, velocity, angles = (_array(state, _below(state, name)) for name in USED["state"])
    command = _array(frames["command"], _below(frames["command"], "command"))
    axes = {name: _array(frames["input"], [name])[:, 0] for name in map(str, frames["input"])}
    for row, edges in zip(trials.to_dict("records"), _edges(trials).T, strict=True):
        first, last = np.searchsorted(due, edges)
        ticks = np.arange(first, last)
        ticks = ticks[running[ticks] & (trial[ticks] == row["trial"])]
        yield Movement(
            row={str(name): value for name, value in row.items()},
            rate_hz=rate_hz,
            due=due[ticks],
            elapsed=elapsed[ticks],
            tip=tip[ticks],
            velocity=velocity[ticks],
            axes={name: values[ticks] for name, values in axes.items()},
            command=command[ticks],
            angles=angles[ticks],
        )


def _is_of(name: str, signals: tuple[str, ...]) -> bool:
    return name in signals or name.rpartition(".")[0] in signals


def _below(table: "pd.DataFrame", signal: str) -> list[str]:
    return [str(name) for name in table if str(name).rpartition(".")[0] == signal]


def _array(table: "pd.DataFrame", columns: list[str]) -> FloatArray:
    return table[columns].to_numpy(np.float64)
