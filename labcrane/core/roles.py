"""The roles a plugin can fill, in the order data flows through them.

    InputDevice -> Controller -> Dynamics -> Task        in the session's loop
    SecondaryTask                                        beside the task
    Cue -> Feedback                                      in processes of their own
    Capture                                              in a process of its own

Each role has exactly one method that runs every tick. The loop calls it directly, never through
pluggy, so it must return soon and must not block. ``labcrane.testing`` has a contract test for
every role; a plugin's tests subclass it.

:class:`~labcrane.analysis.exporter.Exporter` works on recordings, long after.
A Trigger reports events to other devices, in the tick in which they are known.
A SignalMonitor checks external streams, in a process next to the recorder.
An Estimate computes values from them while the session runs, in a process of its own.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

from pydantic import BaseModel

if TYPE_CHECKING:  # a protocol is checked without loading what it does not need
    from labcrane.core.clock import Tick
    from labcrane.core.items import Answers, Item, Score
    from labcrane.core.kernel import Kernel
    from labcrane.core.primitives import Shape, Sphere
    from labcrane.core.records import (
        CameraImage,
        Captured,
        Echo,
        Estimated,
        Frame,
        PlannedTrial,
        Run,
        SessionState,
        Trial,
        TrialStatus,
        Value,
    )
    from labcrane.core.signals import Signal, SignalFault, SignalStream
    from labcrane.machines.machine import Body
    from labcrane.types import FloatArray


class Component(ABC):
    """Anything a protocol can ``use``. Opened once per run, closed exactly once."""

    signals: tuple[Signal, ...] = ()
    """The signals that this component's tick method returns, in order; known before ``open``."""

    def open(self, run: Run) -> None:
        """Acquire hardware and look up signals. Runs before the first tick."""

    def begin_trial(self, trial: Trial) -> None:
        """Forget the last trial. Runs before the trial's first tick."""

    def close(self) -> None:
        """Release what ``open`` acquired. Runs even when ``open`` failed."""

    def metadata(self) -> Mapping[str, Value]:
        """Return facts of the open component for the record: calibration, versions."""
        return {}

    def kernel(self) -> Kernel | None:
        """Return the compiled kernel of the open component's tick, for simulations; None for none.

        For an input device, a controller, a machine or a task: see :mod:`labcrane.core.kernel`.
        Called once per session, and only if numba is installed, so import numba here.
        """
        return None


class InputDevice(Component):
    """The controls that the operator moves: their axes, buttons and whether they are connected."""

    fault: str | None = None
    """Why the device cannot be trusted now, in words; None while all is well.

    Checked after every ``read``. While it is set, the machine is held at rest and the trial is
    paused; both continue automatically when it is None again.
    """

    @abstractmethod
    def read(self, tick: Tick, seen: Frame) -> FloatArray:
        """Return the newest axes, shape ``(n_axes,)``, each in [-1, 1].

        ``seen`` is the frame before: what a person would have seen.
        """


class Controller(Component):
    """Converts the operator's axes into commands for the machine."""

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

        The input of a practised operator, for simulated operators. ``velocity`` is in m/s, shape
        ``(3,)``, in the machine's base frame. Values stay within [-1, 1]: where
        more would be needed, the deflection is full, in the same direction.
        """

    def attainable(self, places: Sequence[Sphere]) -> Mapping[str, float]:
        """Return the tip's speed in m/s that each of its schemes allows at places, by name.

        The median over places and directions; called before ``open``. ``labcrane check`` warns if
        they differ, for a component whose settings provide more than one ``scheme``.
        """
        return {}


class Dynamics(Component):
    """The machine being operated."""

    @abstractmethod
    def state(self) -> FloatArray:
        """Return the present state, shape ``(n_state,)``."""

    @abstractmethod
    def step(self, command: FloatArray, dt: float) -> FloatArray:
        """Advance ``dt`` seconds; return the new state, shape ``(n_state,)``."""

    @abstractmethod
    def reset(self, pose: Sequence[float]) -> None:
        """Set the joints to ``pose`` in rad, at rest, without any history."""

    @abstractmethod
    def bodies(self) -> Sequence[Body]:
        """Return what the machine looks like, for rendering."""


class Task(Component):
    """What the operator is asked to do, and when a trial ends."""

    results: tuple[Signal, ...] = ()
    """Measures of a finished trial, with units and definitions; columns of the trial table.

    Codebook, participant file, report and reference take the definitions from here."""

    conditions: tuple[Signal, ...] = ()
    """Variables of its trials, with units and definitions: the keys of their conditions, which
    are columns of the trial table. The unit of a count or ratio is ``"1"``, of words ``""``."""

    reports: tuple[str, ...] = ()
    """Observations that people can report by a button of either page while its trial runs:
    ``("deformity",)``. A report is the event ``order.report``, with the observation as ``text``:
    the participant's own words could bring names into the record."""

    @abstractmethod
    def factors(self) -> Mapping[str, Sequence[str]]:
        """Return what the design may order: the levels of each factor, as written."""

    @abstractmethod
    def plan(self, levels: Mapping[str, Sequence[str]]) -> Sequence[PlannedTrial]:
        """Return a block's trials, for the levels of each factor in the order given."""

    def places(self) -> Sequence[Sphere]:
        """Return where targets can be in all trials: cameras are framed on them."""
        return ()

    @abstractmethod
    def evaluate(self, frame: Frame) -> TrialStatus:
        """Return the trial's status after this tick. Not called between trials or in a pause."""

    @abstractmethod
    def lift_limits(self) -> None:
        """Let the running trial continue past its automatic ends: a time-out, too many mistakes.

        The experimenter's decision. It holds for this trial only.
        """


class SecondaryTask(Component):
    """A second task that runs beside any task: probes of attention, an n-back, tracking.

    It is switched on trial by trial, as feedback is. ``begin_trial`` begins each trial in which it
    is on. A cue or a sound presents its signals, which views and sounds have in ``frame.task`` with
    the protocol's name before them: ``drt.stimulus``.
    """

    results: tuple[Signal, ...] = ()
    """Its measures of a trial, with units and definitions; columns of the trial table, with the
    protocol's name before them: ``drt_hits``."""

    @abstractmethod
    def evaluate(self, frame: Frame) -> TrialStatus:
        """Return its values and events after this tick; the phase of the status is not used.

        Not called in a pause, between trials, and while it is switched off: ``frame.tick.number``
        shows that ticks are missing.
        """

    @abstractmethod
    def measure(self) -> Mapping[str, Value]:
        """Return the measures of the trial that has just ended, by the names of ``results``."""


class Questionnaire(Component):
    """Items for the participant, and the scores of the answers.

    It is shown on the participant's page or in the terminal; every answer is recorded when it is
    given. The loop does not run it, so it has no tick method.
    """

    title: str
    """Its title, in the language of its items."""

    rights: str
    """The source of its wording, and who may use it."""

    scores: tuple[Score, ...] = ()
    """The scores that :meth:`score` returns, with their ranges."""

    @abstractmethod
    def items(self) -> Sequence[Item]:
        """Return the items in the order of presentation."""

    @abstractmethod
    def score(self, answers: Answers) -> Mapping[str, float]:
        """Return every score by its name; NaN for a score that needs a missing answer."""


class SignalMonitor(Component):
    """Monitors whether the signal of an external stream is alive.

    One is built for every stream that it knows; ``open``, ``begin_trial`` and ``close`` are never
    called. It runs in a process of its own next to the recorder, or for ``streams --watch``. A
    monitor that raises is left out, and this is reported.
    """

    @abstractmethod
    def knows(self, stream: SignalStream) -> bool:
        """Whether it can judge this stream, by its type, rate and channels."""

    @abstractmethod
    def begin(self, stream: SignalStream) -> None:
        """Prepare for a stream, before its first samples; forget all others."""

    @abstractmethod
    def look(self, times: FloatArray, samples: FloatArray) -> Sequence[SignalFault]:
        """Take the next samples and return all present faults, as long as they last.

        Parameters
        ----------
        times
            Timestamps on the source's clock in seconds, shape ``(n,)``; they may jump or repeat.
        samples
            Shape ``(n, n_channels)``, in the units of the stream's header, with all values that the
            source sends; ``n`` is the number of new samples, up to some seconds of them.
        """


class Estimate(Component):
    """Estimates values from a stream while a session runs: load from an EEG, heart rate.

    It runs in a process of its own, which is started again whenever it fails; ``open`` and
    ``begin_trial`` are never called. Its settings are
    :class:`~labcrane.core.settings.EstimateSettings` and name its values.
    """

    @abstractmethod
    def begin(self, stream: SignalStream) -> None:
        """Prepare for a stream, before its first samples; forget all others.

        Raise StreamError if the stream does not have what is needed.
        """

    @abstractmethod
    def update(self, times: FloatArray, samples: FloatArray) -> Estimated | None:
        """Take the next samples; return the newest values, None while there are too few samples.

        Parameters
        ----------
        times
            On the session's clock in seconds, as far as the source's clock is known by now, shape
            ``(n,)``, n > 0; they may jump or repeat.
        samples
            Shape ``(n, n_channels)``, with all values that the source sends.
        """


class Trigger(Component):
    """Reports events to another device by a pulse: a port, a box between LSL and TTL.

    Its codes go out in the tick in which the session learns of an event, after the record and
    before all other reports; if a tick has several, the others follow, one at a time. It is opened
    in every session except with ``--fast``.
    """

    codes: Mapping[str, int] | None = None
    """Codes by the names of events, 1 to 255, the most urgent first; None for the numbers of
    docs/markers.md without those of events that are learnt late."""

    spacing_s: float = 0.0
    """Minimum time between codes, in seconds: the time that the device needs to show one and to
    return to rest. There is always a tick without a code between two."""

    fault: str | None = None
    """Why nothing can be sent now, in words; None while all is well.

    Checked after every ``send``: a code that could not be sent is recorded as not sent. The
    session continues and reports this.
    """

    @abstractmethod
    def send(self, codes: Sequence[int], now: float) -> Sequence[Echo]:
        """Send a tick's code, mostly none; return the echoes since the last one.

        Called in every tick, and must not wait. Report a device that is gone by ``fault``; do not
        raise.

        Parameters
        ----------
        codes
            None or one, 1 to 255.
        now
            In seconds on the session's clock, to end a pulse.
        """


class Capture(Component):
    """A camera, a microphone or a screen, recorded into files next to the participant file.

    It runs in a process of its own, which is started again whenever it fails. ``open`` and
    ``begin_trial`` are never called. Its settings are
    :class:`~labcrane.core.settings.CaptureSettings`.
    """

    suffix: str = ".mkv"
    """How the names of its files end."""

    windows: Mapping[str, str] = MappingProxyType({})
    """Titles of the windows of the study's views, by view; set before ``begin``."""

    @abstractmethod
    def begin(self) -> None:
        """Open the device. Runs before the first ``read``; raise DeviceError if it is not there."""

    @abstractmethod
    def write_to(self, path: Path) -> None:
        """Write the frames from now on to a new file, for the user only."""

    @abstractmethod
    def read(self) -> Sequence[Captured]:
        """Wait for a frame and write it; return the frames that are now safely in the file.

        A frame is in the file when it is there even if the process is killed. Before ``write_to``
        nothing is written. Raise DeviceError when the device is gone or the disk is full.
        """

    @abstractmethod
    def end(self) -> Sequence[Captured]:
        """End the file; return the frames in it that were not returned yet."""


class Cue(Component):
    """Something the operator sees, drawn into every view and computed again from a recording.

    Its signals are the numbers behind the picture; they are recorded with every frame shown.
    """

    @abstractmethod
    def draw(self, frame: Frame) -> Sequence[Shape]:
        """Return the shapes to show; the same frame always gives the same shapes.

        ``frame.task`` is NaN where the task gives no value; then there is nothing to draw.
        """

    def values(self, frame: Frame) -> FloatArray:
        """Return the numbers behind the picture, shape ``(n_signals,)``, as pure as ``draw``."""
        import numpy as np  # noqa: PLC0415

        return np.empty(0)


class Feedback(Component):
    """Presents the session to people: a view, a sound, a lamp.

    It runs in a process of its own, at its own pace: each time it is ready it is given the newest
    frame; frames in between are skipped. Its signals are recorded with every frame presented.
    """

    streams: Mapping[str, tuple[Signal, ...]] = {}
    """Further streams that it fills, by name; see ``samples``."""

    cameras: tuple[str, ...] = ()
    """Names of the cameras whose pictures the experimenter's page shows; see ``pictures``."""

    title: str = ""
    """Title of its window; set before it is opened."""

    before: Sequence[BaseModel] = ()
    """Settings of earlier components of the same kind in the protocol, which may have windows
    already; set before it is opened."""

    def update(self, situation: SessionState) -> None:
        """Take the session's state, before the first frame and whenever it changes."""

    @abstractmethod
    def present(self, frame: Frame) -> FloatArray:
        """Show or sound ``frame``; return what was presented, shape ``(n_signals,)``.

        ``frame.shapes`` contains the shapes of the active cues. The moment at which this returns is
        recorded as the moment of presentation.
        """

    def idle(self) -> None:
        """Present nothing: between trials, and where the protocol switches it off."""

    def adjust(self, settings: BaseModel) -> bool:
        """Apply other settings while open, if possible; return whether it was.

        The experimenter changes them while a session runs. If not possible, this component is
        closed and rebuilt, which may take long, as for windows and sound servers.
        """
        return False

    def preview(self, run: Run, frames: Sequence[Frame], path: Path) -> Sequence[Path]:
        """Write what consecutive frames look or sound like to files, and return their paths.

        ``path`` is where they go, without an ending. It needs neither display nor device, nor
        an open component. A component that cannot be written to a file writes none.
        """
        return ()

    def samples(self) -> Mapping[str, FloatArray]:
        """Return a sample for each of ``streams``; called after every ``present``.

        Several samples of one stream are rows in order: changes between two frames.
        """
        return {}

    def pictures(self) -> Mapping[str, CameraImage]:
        """Return what ``cameras`` show, as of the last ``present``; none while none is due.

        Called after a ``present`` while a page shows them.
        """
        return {}
