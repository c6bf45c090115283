"""One movement's arrays, cut out of a session."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from labcrane.analysis.kinematics.halts import ROUNDING_S
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
    "command": ("command", "assist.share", "assist.operator", "assist.assistant"),
    "state": ("tip.position", "tip.velocity", "joint.angle"),
}
"""Signals that a movement has, by group; all of them where none is named."""


HANDS = ("operator", "assistant")
"""Who moves the machine in a study with an assistant."""


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
    assist
        With an assistant: its ``share``, shape ``(n, 1)``, and the joint speeds in rad/s that
        ``operator`` and ``assistant`` asked for, shape ``(n, n_joints)``; empty without one.
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
    assist: Mapping[str, FloatArray] = field(default_factory=dict)

    @cached_property
    def speed(self) -> FloatArray:
        """Speed of the tip in m/s, shape ``(n,)``."""
        speed: FloatArray = np.linalg.norm(self.velocity, axis=1)
        return speed

    @cached_property
    def span(self) -> slice | None:
        """The ticks from onset to offset, both included; None when one of them is missing.

        For a task without errors, which has no aim, a movement begins with the reaction; so do the
        recordings of an aim before there was a ``movement_onset``.
        """
        aimed = not np.isnan(self.result("error_along")) and "movement_onset" in self.row
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

    However long the session, so many ticks are in memory as the longest trial has, or
    :data:`TICKS`.
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
        yield from cut(frames, trials.iloc[at:after], rate_hz)
        at = after


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
    asked = frames["command"]
    command = _array(asked, _below(asked, "command"))
    assist = {}
    if "assist.share" in asked:
        assist = {who: _array(asked, _below(asked, f"assist.{who}")) for who in HANDS}
        assist["share"] = _array(asked, ["assist.share"])
    others = ("assist.", "estimate.")
    own = [name for name in map(str, frames["input"]) if not name.startswith(others)]
    axes = {name: _array(frames["input"], [name])[:, 0] for name in own}
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
            assist={name: values[ticks] for name, values in assist.items()},
        )


def _is_of(name: str, signals: tuple[str, ...]) -> bool:
    return name in signals or name.rpartition(".")[0] in signals


def _below(table: "pd.DataFrame", signal: str) -> list[str]:
    return [str(name) for name in table if str(name).rpartition(".")[0] == signal]


def _array(table: "pd.DataFrame", columns: list[str]) -> FloatArray:
    return table[columns].to_numpy(np.float64)
