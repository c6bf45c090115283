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
"""What an event, a condition or a result may hold: what JSON and a table cell can."""


class Phase(StrEnum):
    """Where a trial stands, and how it ended."""

    IDLE = "idle"  # between trials
    RUNNING = "running"
    SUCCESS = "success"
    FAILURE = "failure"
    TIMEOUT = "timeout"
    SKIPPED = "skipped"  # by command
    REPEATED = "repeated"  # by command: the same trial follows as a new attempt
    ENDED = "ended"  # by command: the session ended in the middle of the trial
    INTERRUPTED = "interrupted"  # the session's process died in the middle of the trial

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
        What else is to be known, ready for JSON.
    """

    name: str
    time: float
    data: Mapping[str, Value] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class PlannedTrial:
    """One trial as a task plans it.

    Attributes
    ----------
    condition
        What is varied in it; becomes columns of the trial table.
    expected_s
        How long it is likely to take, in seconds.
    counted
        Whether it is a result. An approach is recorded, but is no row of the trial table.
    start_pose
        Joint angles in rad, one per joint, to which the machine is set before the trial; None
        lets it go on from where it stands.
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
        Counts the session's trials from 1, uncounted ones included.
    attempt
        Counts from 1; more when the trial was repeated.
    seed
        Seeds everything random in the trial, so that it can be run again.
    planned
        What the task planned.
    """

    number: int
    attempt: int
    seed: int
    planned: PlannedTrial


@dataclass(frozen=True, slots=True)
class TrialStatus:
    """What a task makes of a frame.

    Attributes
    ----------
    phase
        Where the trial stands after this tick.
    values
        The task's own signals, shape ``(n_task,)``: the target, for instance.
    events
        What happened in this tick.
    results
        Measures of the finished trial by the names of ``Task.results``; empty while it runs.
    """

    phase: Phase
    values: FloatArray
    events: tuple[Event, ...] = ()
    results: Mapping[str, Value] = field(default_factory=dict)


@dataclass(frozen=True)
class Run:
    """What is being run: given to every component when it opens.

    Attributes
    ----------
    rate_hz
        Ticks per second.
    machine
        What is operated.
    participant_seed
        Seeds what belongs to the participant rather than to a trial.
    axes, command, state, task
        What the frame's arrays of the same names hold.
    inverse
        The axes, shape ``(n_axes,)``, with which a practised hand asks this controller for a tip
        velocity in m/s, shape ``(3,)``, in a state, shape ``(n_state,)``. For simulated operators.
    bodies
        What the machine looks like, for whoever draws it.
    places
        Where the tasks' targets can be, for whoever must keep them in sight.
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
        Shapes ``(n_axes,)``, ``(n_command,)``, ``(n_state,)``, ``(n_task,)``; what they hold is
        in the run's layouts. ``task`` is NaN between trials.
    phase
        Where the trial stood at the end of the tick.
    trial
        Number of the trial, 0 between trials.
    paused
        Whether the command was held at rest.
    events
        What happened, in order.
    shapes
        What the active cues drew of it; filled in for whoever presents the frame, and nowhere else.
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
    """A code that came back from where it was sent to.

    Attributes
    ----------
    code
        What came back, 1 to 255; a bare number.
    time
        When, in seconds on the session's clock, which is ``time.perf_counter``.
    """

    code: int
    time: float


@dataclass(frozen=True, slots=True)
class SessionState:
    """What a session is about now, for whoever presents it.

    Attributes
    ----------
    step, kind
        Number and kind of the step, 0 before the first.
    block, block_name, practice
        The block under way.
    trial, trials
        Number of the trial, 0 between trials, and how many counted ones the session has.
    counted, done
        Which of the counted trials is running, 0 for none, and how many are over.
    active
        Names of the cues and sounds that are switched on; empty between trials.
    settings
        Settings that the examiner changed, by name of the cue or sound.
    counts
        How often each event has happened.
    text
        What the operator is to read as long as it is there: the instructions of the step; empty
        for nothing.
    questionnaire
        The title of the questionnaire that is asked; empty for none.
    hint, hint_time
        The examiner's newest hint, empty before the first, and when it was given.
    scene
        What stands around the machine, as of :func:`labcrane.machines.read_placed`; empty for
        nothing.
    held
        Who or what holds the session: the examiner, a stop rule, a part that is lost.
    waiting
        What the session waits with for the examiner's order, or that there is a break; empty while
        it does not wait.
    over
        Why the session has ended; empty until it has.
    fixation
        The point that the operator is to look at, as shares of the picture's width and height;
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
"""How an attempt ends that is not its trial's last."""


def is_counted(about: Mapping[str, Value]) -> bool:
    """Whether a trial is one that the study is about: no practice, and not just the way to it.

    ``about`` is what the trial's events say of it.
    """
    return bool(about.get("counted")) and not about.get("practice")


def is_done(ended: Mapping[str, Value]) -> bool:
    """Whether a counted trial is over for good, by its ``trial.end``.

    One that is repeated is not, nor one in whose middle the session stopped.
    """
    return is_counted(ended) and ended.get("outcome") not in UNDONE


@dataclass(frozen=True, slots=True, eq=False)
class CameraImage:
    """What a camera shows, for the supervisor's page.

    Attributes
    ----------
    pixels
        From the top: greys, shape ``(height, width)``, or red, green and blue, shape
        ``(height, width, 3)``.
    due
        When what it shows happened: the time at which that frame was due, in seconds.
    legend
        What its greys mean, in words; empty when they need none.
    """

    pixels: npt.NDArray[np.uint8]
    due: float
    legend: str = ""
