"""The roles a plugin can fill, in the order data flows through them.

    InputDevice -> Controller -> Dynamics -> Task        in the session's loop
    Cue -> Feedback                                      in processes of their own

Each role has exactly one method that runs every tick. The loop calls it directly, never through
pluggy, so it must return soon and must not block. ``labcrane.testing`` has a contract test for
every role; a plugin's tests subclass it.

:class:`~labcrane.analysis.exporter.Exporter` works on what was recorded, long after.
A Trigger tells other devices of events, in the tick in which they are known.
A SignalMonitor looks at the streams of other programs, in a process beside the recorder.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pydantic import BaseModel

if TYPE_CHECKING:  # a protocol is checked without loading what it does not need
    from labcrane.core.clock import Tick
    from labcrane.core.items import Answers, Item, Score
    from labcrane.core.primitives import Shape, Sphere
    from labcrane.core.records import (
        CameraImage,
        Echo,
        Frame,
        PlannedTrial,
        Run,
        SessionState,
        Trial,
        TrialStatus,
        Value,
    )
    from labcrane.core.signals import Signal, SignalFault, SignalStream
    from labcrane.core.twin import Twin
    from labcrane.machines.machine import Body
    from labcrane.types import FloatArray


class Component(ABC):
    """Anything a protocol can ``use``. Opened once per run, closed exactly once."""

    signals: tuple[Signal, ...] = ()
    """What this component's tick method returns, in order; known before ``open``."""

    def open(self, run: Run) -> None:
        """Acquire hardware and look up signals. Runs before the first tick."""

    def begin_trial(self, trial: Trial) -> None:
        """Forget the last trial. Runs before the trial's first tick."""

    def close(self) -> None:
        """Release what ``open`` acquired. Runs even when ``open`` failed."""

    def metadata(self) -> Mapping[str, Value]:
        """Return what the record should know of the open component: calibration, versions."""
        return {}

    def twin(self) -> Twin | None:
        """Return the compiled twin of the open component's tick, for simulations; None for none.

        Of an input device, a controller, a machine or a task: see :mod:`labcrane.core.twin`. Asked
        for once a session, and only where numba is installed, so import it there.
        """
        return None


class InputDevice(Component):
    """What the operator moves. Its signals are axes, buttons and whether it is connected."""

    fault: str | None = None
    """Why the device cannot be trusted now, in words; None while all is well.

    Looked at after every ``read``. While it is set the machine is held at rest and the trial is
    paused; both go on by themselves when it is None again.
    """

    @abstractmethod
    def read(self, tick: Tick, seen: Frame) -> FloatArray:
        """Return the newest axes, shape ``(n_axes,)``, each in [-1, 1].

        ``seen`` is the frame before: what a person would have seen.
        """


class Controller(Component):
    """What turns the operator's axes into commands for the machine."""

    @abstractmethod
    def command(self, axes: FloatArray, state: FloatArray) -> FloatArray:
        """Return the command, shape ``(n_command,)``: actuators first, then what else to log."""

    def idle(self) -> FloatArray:
        """Return the command that holds the machine still, shape ``(n_command,)``."""
        import numpy as np  # noqa: PLC0415

        return np.zeros(sum(len(signal.columns) for signal in self.signals))

    @abstractmethod
    def inverse(self, velocity: FloatArray, state: FloatArray) -> FloatArray:
        """Return the axes, shape ``(n_axes,)``, that ask for a tip velocity.

        What a practised hand does; simulated operators use it. ``velocity`` is in m/s, shape
        ``(3,)``, in the machine's base frame. Nothing beyond [-1, 1] is returned: a hand that
        would need more pushes as far as it goes, in the same direction.
        """

    def attainable(self, places: Sequence[Sphere]) -> Mapping[str, float]:
        """Return the tip's speed in m/s that each of its schemes allows at places, by name.

        The median over places and directions, asked for before ``open``. ``labcrane check`` asks
        where they differ, of a component whose settings say that it provides more than one
        ``scheme``.
        """
        return {}


class Dynamics(Component):
    """The machine being operated."""

    @abstractmethod
    def state(self) -> FloatArray:
        """Return the state as it stands, shape ``(n_state,)``."""

    @abstractmethod
    def step(self, command: FloatArray, dt: float) -> FloatArray:
        """Advance ``dt`` seconds; return the new state, shape ``(n_state,)``."""

    @abstractmethod
    def reset(self, pose: Sequence[float]) -> None:
        """Set the joints to ``pose`` in rad, at rest, as if nothing had happened before."""

    @abstractmethod
    def bodies(self) -> Sequence[Body]:
        """Return what the machine looks like, for whoever draws it."""


class Task(Component):
    """What the operator is asked to do, and when a trial ends."""

    results: tuple[Signal, ...] = ()
    """What a finished trial is measured by, with units and definitions; columns of the trial table.

    Codebook, participant file, report and reference take the definitions from here."""

    conditions: tuple[Signal, ...] = ()
    """What is varied in its trials, with units and definitions: the keys of their conditions, which
    are columns of the trial table. The unit of a count or ratio is ``"1"``, of words ``""``."""

    reports: tuple[str, ...] = ()
    """What people may say by a button of either page that they have seen, while a trial of it runs:
    ``("deformity",)``. It comes as the event ``order.report``, with it as ``text``."""

    @abstractmethod
    def factors(self) -> Mapping[str, Sequence[str]]:
        """Return what the design may order: the levels of each factor, as written."""

    @abstractmethod
    def plan(self, levels: Mapping[str, Sequence[str]]) -> Sequence[PlannedTrial]:
        """Return a block's trials, for the levels of each factor in the order given."""

    def places(self) -> Sequence[Sphere]:
        """Return where targets can be, of all trials together: cameras are framed on them."""
        return ()

    @abstractmethod
    def evaluate(self, frame: Frame) -> TrialStatus:
        """Say where the trial stands after this tick. Not called between trials or in a pause."""

    @abstractmethod
    def lift_limits(self) -> None:
        """Let the running trial go on past its automatic ends: a time-out, too many mistakes.

        The supervisor's decision. It holds for this trial only.
        """


class Questionnaire(Component):
    """Questions put to the participant, and what the answers are worth.

    Shown on the participant's page or asked in the terminal; every answer is recorded the moment
    it is given. It is asked in a session, so it has no tick method.
    """

    title: str
    """What people call it, in the language in which it asks."""

    rights: str
    """Where its words come from, and who may use them."""

    scores: tuple[Score, ...] = ()
    """What :meth:`score` returns, and in which range."""

    @abstractmethod
    def items(self) -> Sequence[Item]:
        """Return the questions, in the order in which they are asked."""

    @abstractmethod
    def score(self, answers: Answers) -> Mapping[str, float]:
        """Return every score by its name; NaN for one that needs an answer that is missing."""


class SignalMonitor(Component):
    """What tells whether the signal of a stream of another program is alive.

    Built anew for every stream that it knows; ``open``, ``begin_trial`` and ``close`` are never
    called. It runs in a process of its own beside the recorder, or behind ``streams --watch``. One
    that raises is left out, and that is said.
    """

    @abstractmethod
    def knows(self, stream: SignalStream) -> bool:
        """Whether it can judge this stream, by its type, rate and channels."""

    @abstractmethod
    def begin(self, stream: SignalStream) -> None:
        """Be told which stream comes, before its first samples; forget all others."""

    @abstractmethod
    def look(self, times: FloatArray, samples: FloatArray) -> Sequence[SignalFault]:
        """Take the next samples and return all that is wrong now, for as long as it is.

        Parameters
        ----------
        times
            Stamps on the source's clock in seconds, shape ``(n,)``; they may jump or repeat.
        samples
            Shape ``(n, n_channels)``, in the units of the stream's header, with whatever the source
            sends; ``n`` is what has come, from 1 to some seconds of it.
        """


class Trigger(Component):
    """What tells another device of events by a pulse: a port, a box between LSL and TTL.

    Its codes go out in the tick in which the session learns of an event, after the record and
    before everything else that is told; of several in one tick the others follow, one at a time. It
    is opened in every session but those of ``--fast``.
    """

    codes: Mapping[str, int] | None = None
    """Codes by the names of events, 1 to 255, the most urgent first; None for the numbers of
    docs/markers.md without those of events that are learnt late."""

    spacing_s: float = 0.0
    """Least time from one code to the next, in seconds: as long as the device takes to show it and
    to rest. There is always a tick without a code between two."""

    fault: str | None = None
    """Why nothing can be sent now, in words; None while all is well.

    Looked at after every ``send``: what was to be sent then is recorded as not sent. The session
    goes on, and says so.
    """

    @abstractmethod
    def send(self, codes: Sequence[int], now: float) -> Sequence[Echo]:
        """Send a tick's code, mostly none; return what has come back since the last one.

        Called in every tick, and must not wait. A device that is gone is told by ``fault``, not
        raised.

        Parameters
        ----------
        codes
            None or one, 1 to 255.
        now
            In seconds on the session's clock: for what ends a pulse.
        """


class Cue(Component):
    """Something the operator sees, drawn into every view and computed again from a recording.

    Its signals are the numbers behind the picture; they are recorded with every frame shown.
    """

    @abstractmethod
    def draw(self, frame: Frame) -> Sequence[Shape]:
        """Return what is to be seen; the same frame always gives the same shapes.

        ``frame.task`` is NaN where the task says nothing, and then there is nothing to draw.
        """

    def values(self, frame: Frame) -> FloatArray:
        """Return the numbers behind the picture, shape ``(n_signals,)``, as pure as ``draw``."""
        import numpy as np  # noqa: PLC0415

        return np.empty(0)


class Feedback(Component):
    """What presents the session to people: a view, a sound, a lamp.

    It runs in a process of its own, at its own pace: each time it is ready it is given the newest
    frame, and those in between are left out. Its signals are recorded with every frame presented.
    """

    streams: Mapping[str, tuple[Signal, ...]] = {}
    """Further streams it fills, by name, beside its signals; see ``samples``."""

    cameras: tuple[str, ...] = ()
    """Names of the cameras whose pictures the supervisor's page shows; see ``pictures``."""

    title: str = ""
    """What a window of it is called; set before it is opened."""

    before: Sequence[BaseModel] = ()
    """Settings of others of the same kind that the protocol names before it, which may have windows
    already; set before it is opened."""

    def update(self, situation: SessionState) -> None:
        """Be told what the session is about, before the first frame and whenever it changes."""

    @abstractmethod
    def present(self, frame: Frame) -> FloatArray:
        """Show or sound ``frame``; return what was presented, shape ``(n_signals,)``.

        ``frame.shapes`` is what the active cues drew. The moment at which this returns is
        recorded as the moment of presentation.
        """

    def idle(self) -> None:
        """Present nothing: between trials, and where the protocol switches it off."""

    def adjust(self, settings: BaseModel) -> bool:
        """Take other settings while open, if that is possible; whether it was.

        The examiner changes them while a session runs. Otherwise this component is closed and
        built anew, which may take long: windows and sound servers do.
        """
        return False

    def preview(self, run: Run, frames: Sequence[Frame], path: Path) -> Sequence[Path]:
        """Write what consecutive frames look or sound like to files, and return their paths.

        ``path`` is where they go, without an ending. Needs neither display nor device, and not to
        be open. What cannot be written to a file writes none.
        """
        return ()

    def samples(self) -> Mapping[str, FloatArray]:
        """Return a sample for each of ``streams``; asked for after every ``present``.

        Several samples of one stream are rows, in their order: what changed between two frames.
        """
        return {}

    def pictures(self) -> Mapping[str, CameraImage]:
        """Return what ``cameras`` show, as of the last ``present``; none while none is due.

        Asked for after a ``present`` while somebody watches.
        """
        return {}
