"""The plain data that flows through a run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from labcrane.core.clock import Tick
    from labcrane.core.primitives import Shape, Sphere
    from labcrane.core.signals import Layout
    from labcrane.machines.machine import Body, Machine
    from labcrane.types import FloatArray

Value = float | int | str | bool | None
"""Values of events, conditions and results: those that fit JSON and a table cell."""


class Phase(StrEnum):
    """State of a trial, and how it ended."""

    IDLE = "idle"  # between trials
    RUNNING = "running"
    SUCCESS = "success"
    FAILURE = "failure"
    TIMEOUT = "timeout"
    SKIPPED = "skipped"  # by command
    REPEATED = "repeated"  # by command: the same trial follows as a new attempt
    ENDED = "ended"  # by command: the session ended in the middle of the trial
    INTERRUPTED = "interrupted"  # the session's process died or stalled in the middle of the trial

    over: bool
    """Whether the trial has ended."""

    def __init__(self, name: str) -> None:
        self.over = name not in {"idle", "running"}


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened at one moment.

    Attributes
    ----------
    name
        Dotted noun and verb: ``"trial.start"``.
    time
        When it happened in the simulation, in seconds on the run's clock.
    data
        Further facts, ready for JSON.
    """

    name: str
    time: float
    data: Mapping[str, Value] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Captured:
    """A frame of a recording that is in its file: a picture, or a piece of sound.

    The uncertainty of its time is the sum of the three terms, in seconds. One that is not known is
    NaN.

    Attributes
    ----------
    number
        Counted from 0 in each file, with the frames that were dropped.
    pts
        Where it is in the file, in seconds.
    time
        When it was captured, in seconds on the session's clock.
    clock
        How well the clock of the device's timestamp is known.
    arrival
        How far the moment of capture is open, because only the arrival of the frame is known.
    lag
        How well the device's lag is known, which is subtracted already.
    """

    number: int
    pts: float
    time: float
    clock: float
    arrival: float
    lag: float


@dataclass(frozen=True, slots=True)
class PlannedTrial:
    """One trial as a task plans it.

    Attributes
    ----------
    condition
        Its values of the varied factors; they become columns of the trial table.
    expected_s
        Expected duration in seconds.
    counted
        Whether it is a result. An approach movement is recorded, but not in the trial table.
    start_pose
        Joint angles in rad, one per joint, to which the machine is set before the trial; None
        leaves the machine where it is.
    """

    condition: Mapping[str, Value]
    expected_s: float
    counted: bool = True
    start_pose: tuple[float, ...] | None = None


@dataclass(frozen=True, slots=True)
class Trial:
    """One attempt at one planned trial.

    Attributes
    ----------
    number
        Number in the session, from 1, uncounted trials included.
    attempt
        From 1; greater when the trial was repeated.
    seed
        Seed of everything random in the trial, so that it can be reproduced.
    planned
        The trial as the task planned it.
    start_pose
        Joint angles in rad at which a further attempt begins, since the first one did; None for
        the first.
    active
        Names of the feedback and the secondary tasks that are switched on.
    """

    number: int
    attempt: int
    seed: int
    planned: PlannedTrial
    start_pose: tuple[float, ...] | None = None
    active: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class TrialStatus:
    """A task's evaluation of a frame.

    Attributes
    ----------
    phase
        The trial's state after this tick.
    values
        The task's own signals, shape ``(n_task,)``: the target, for instance.
    events
        Events of this tick.
    results
        Measures of the finished trial by the names of ``Task.results``; empty while it runs.
    """

    phase: Phase
    values: FloatArray
    events: tuple[Event, ...] = ()
    results: Mapping[str, Value] = field(default_factory=dict)


@dataclass(frozen=True)
class Run:
    """Facts of a run, given to every component when it opens.

    Attributes
    ----------
    rate_hz
        Ticks per second.
    machine
        The machine that is operated.
    participant_seed
        Seed of what belongs to the participant rather than to a trial.
    axes, command, state, task
        Layouts of the frame's arrays of the same names.
    inverse
        The axes, shape ``(n_axes,)``, with which a practised operator commands a tip
        velocity in m/s, shape ``(3,)``, in a state, shape ``(n_state,)``. For simulated operators.
    bodies
        What the machine looks like, for rendering.
    places
        Where the tasks' targets can be, for cameras that must keep them in sight.
    """

    rate_hz: float
    machine: Machine
    participant_seed: int
    axes: Layout
    command: Layout
    state: Layout
    task: Layout
    inverse: Callable[[FloatArray, FloatArray], FloatArray]
    bodies: tuple[Body, ...] = ()
    places: tuple[Sphere, ...] = ()


@dataclass(frozen=True, slots=True)
class Estimated:
    """Values of an estimate. Times in seconds, on the clock of the times that it was given.

    Attributes
    ----------
    time
        What the values stand for: the moment from which they are known, or the middle of a window.
    first
        The first sample that they were computed from; the last is the newest that was given.
    values
        In the order of :attr:`EstimateSettings.values`; NaN for one that cannot be computed.
    """

    time: float
    first: float
    values: tuple[float, ...]


@dataclass(slots=True)
class Frame:
    """Everything that happened in one tick.

    The arrays belong to the components that made them and may change on the next tick: copy
    what you keep.

    Attributes
    ----------
    tick
        Number, due and wake-up time.
    elapsed
        Seconds of the trial so far, pauses left out; 0 on its first tick.
    axes, command, state, task
        Shapes ``(n_axes,)``, ``(n_command,)``, ``(n_state,)``, ``(n_task,)``; the run's
        layouts name their contents. ``task`` is NaN between trials.
    phase
        The trial's state at the end of the tick.
    trial
        Number of the trial, 0 between trials.
    paused
        Whether the command was held at rest.
    events
        Events of the tick, in order.
    shapes
        Shapes of the active cues; filled in only where the frame is presented.
    """

    tick: Tick
    elapsed: float
    axes: FloatArray
    command: FloatArray
    state: FloatArray
    task: FloatArray
    phase: Phase = Phase.IDLE
    trial: int = 0
    paused: bool = False
    events: tuple[Event, ...] = ()
    shapes: tuple[Shape, ...] = ()


@dataclass(frozen=True, slots=True)
class Echo:
    """A trigger code that the device sent back.

    Attributes
    ----------
    code
        The code, 1 to 255.
    time
        When it came, in seconds on the session's clock, which is ``time.perf_counter``.
    """

    code: int
    time: float


@dataclass(frozen=True, slots=True)
class SessionState:
    """The present state of a session, for presentation.

    Attributes
    ----------
    step, kind
        Number and kind of the step, 0 before the first.
    block, block_name, practice
        The block under way.
    trial, trials
        Number of the trial, 0 between trials, and the number of counted ones in the session.
    counted, done
        Number of the running trial among the counted ones, 0 for none, and how many are over.
    active
        Names of the cues and sounds that are switched on; empty between trials.
    settings
        Settings that the experimenter changed, by name of the cue or sound.
    counts
        Number of times that each event has happened.
    text
        Text for the operator to read: the instructions of the step; empty
        for none.
    questionnaire
        The title of the questionnaire under way; empty for none.
    hint, hint_time
        The experimenter's latest hint, empty before the first, and when it was given.
    scene
        The scene around the machine, see :func:`labcrane.machines.read_placed`; empty for
        none.
    held
        Who or what holds the session: the experimenter, a stop rule, a lost part.
    waiting
        What waits for the experimenter's action, or that there is a break; empty while
        it does not wait.
    over
        Reason for the session's end; empty until then.
    fixation
        The fixation point, as shares of the picture's width and height;
        empty for none.
    """

    step: int = 0
    kind: str = ""
    block: int = 0
    block_name: str = ""
    practice: bool = False
    trial: int = 0
    trials: int = 0
    counted: int = 0
    done: int = 0
    active: tuple[str, ...] = ()
    settings: Mapping[str, Mapping[str, Value]] = field(default_factory=dict)
    counts: Mapping[str, int] = field(default_factory=dict)
    text: str = ""
    questionnaire: str = ""
    hint: str = ""
    hint_time: float = 0.0
    scene: str = ""
    held: tuple[str, ...] = ()
    waiting: str = ""
    over: str = ""
    fixation: tuple[float, ...] = ()


UNDONE = frozenset({Phase.REPEATED, Phase.ENDED, Phase.INTERRUPTED})
"""Outcomes of attempts that are not the trial's last."""


def is_counted(about: Mapping[str, Value]) -> bool:
    """Whether a trial is part of the results: neither practice nor an approach movement.

    ``about`` is the data of the trial's events.
    """
    return bool(about.get("counted")) and not about.get("practice")


def is_done(ended: Mapping[str, Value]) -> bool:
    """Whether a counted trial is finally over, by its ``trial.end``.

    A repeated trial is not, nor one that the session's end interrupted.
    """
    return is_counted(ended) and ended.get("outcome") not in UNDONE


@dataclass(frozen=True, slots=True, eq=False)
class CameraImage:
    """A camera's picture, for the experimenter's page.

    Attributes
    ----------
    pixels
        From the top: greys, shape ``(height, width)``, or red, green and blue, shape
        ``(height, width, 3)``.
    due
        The time at which the shown frame was due, in seconds.
    legend
        The meaning of its greys, in words; empty if none is needed.
    """

    pixels: npt.NDArray[np.uint8]
    due: float
    legend: str = ""
