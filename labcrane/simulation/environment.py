"""A study as an environment of gymnasium: the same task and machine for a policy as for a person.

``gymnasium.make("labcrane.simulation.environment:labcrane/Study-v0", protocol="protocol.yaml")``;
``"labcrane/Study-v0"`` will do once this module is imported, as gymnasium wants it. Each episode is
a trial of the study, led by the sequencer that leads people through it.
"""

from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

from labcrane.core.clock import ManualClock, Tick, ticks
from labcrane.core.records import Event, Frame, Phase, Run
from labcrane.core.roles import InputDevice
from labcrane.core.signals import Signal
from labcrane.design.plan import plan_session
from labcrane.errors import ProtocolError
from labcrane.files.pseudonyms import pseudonyms
from labcrane.protocol.rig import Rig
from labcrane.protocol.study import Study, load
from labcrane.recording.frame_log import FrameLog, columns
from labcrane.recording.journal import START, SessionJournal
from labcrane.recording.participant_file.writer import consolidate
from labcrane.recording.paths import journal_path, participant_path
from labcrane.registry.registry import discover
from labcrane.session import loop
from labcrane.session.commands import Command, Order
from labcrane.session.sequencer import Sequencer
from labcrane.types import FloatArray

ID = "labcrane/Study-v0"

Observation = tuple[FloatArray, dict[str, Any]]


class PolicyInput(InputDevice):
    """Axes that a policy sets before each tick."""

    def __init__(self, signals: tuple[Signal, ...], size: int) -> None:
        self.signals = signals
        self.axes = np.zeros(size)

    def read(self, tick: Tick, seen: Frame) -> FloatArray:
        return self.axes


@dataclass
class _Session:
    """One participant's session under way."""

    device: PolicyInput
    sequencer: Sequencer
    make_frame: loop.FrameMaker
    ticks: Iterator[Tick]
    frame: Frame
    log: FrameLog | None
    acting: bool = False  # whether the trial that reset has gone on to still runs


class StudyEnvironment(gymnasium.Env[FloatArray, FloatArray]):
    """Trials of a study, in the order of a participant's plan; a seed chooses the participant.

    Actions are the axes of the operator's controls, in [-1, 1], held for one tick. Observations are
    the machine's state and the task's signals in SI units, as frames hold them. The reward is 1 in
    the tick in which a trial succeeds, else 0. An episode is terminated by success or failure, and
    truncated when its time is over. What ``info`` holds: trial, attempt, condition and results.

    Parameters
    ----------
    protocol
        The study's protocol file.
    record
        A folder: every session that a policy acts in is recorded there, and the participant file
        that ``close`` makes of it is an input like a recorded operator's (``use: recorded``).
    participant
        Whose plan is run when no seed was given; the study's first by default.

    Attributes
    ----------
    observation_names, action_names
        Names of the columns: ``state.joint.angle.slew``, ``input.left.x``.

    Raises
    ------
    ProtocolError
        The protocol cannot be run.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012 - gymnasium's own

    def __init__(
        self, protocol: Path | str, record: Path | str | None = None, participant: str | None = None
    ) -> None:
        path = Path(protocol)
        self._study: Study = load(path, discover(study=path))
        self._record = None if record is None else Path(record)
        who = self._study.protocol.participants
        self._participant = participant or pseudonyms(who.pattern, 1)[0]
        self._sessions = 0
        self._session: _Session | None = None
        self._closing = ExitStack()
        rig, device = self._build()
        run = rig.describe(self._study, 0)
        self.observation_names = tuple(
            f"{group}.{name}"
            for group, layout in (("state", run.state), ("task", run.task))
            for name in layout.columns
        )
        self.action_names = tuple(f"input.{name}" for name in run.axes.columns)
        size = len(self.observation_names)
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (size,), np.float64)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, device.axes.shape, np.float64)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> Observation:
        """Go on to the next trial; with a seed, to the first trial of a participant drawn by it."""
        super().reset(seed=seed)
        if seed is not None:
            self._leave()
            self._participant = self._drawn()
        session = self._session or self._begin()
        if session.acting:  # the trial before was not acted to its end
            self._tick(session, (Command(Order.SKIP),))
        session.device.axes = np.zeros_like(session.device.axes)
        while True:
            frame = self._tick(session)
            if frame.phase is Phase.RUNNING:
                session.acting = True
                return self._seen(frame), self._told(frame)
            if session.sequencer.over:
                self._leave()
                self._participant = self._drawn()
                session = self._begin()

    def step(self, action: FloatArray) -> tuple[FloatArray, float, bool, bool, dict[str, Any]]:
        """Act for one tick.

        Raises
        ------
        ProtocolError
            No trial is running, or the action is not one of the action space.
        """
        session = self._session
        if session is None or not session.acting:
            raise ProtocolError("no trial is running; reset begins the next one")
        given = np.asarray(action, np.float64)
        if given.shape != session.device.axes.shape or not (np.abs(given) <= 1.0).all():
            raise ProtocolError(
                f"an action has {session.device.axes.size} axes from -1 to 1 "
                f"({', '.join(self.action_names)}), not {action!r}"
            )
        session.device.axes = given
        frame = self._tick(session)
        ended = frame.phase in {Phase.SUCCESS, Phase.FAILURE}
        cut = frame.phase.over and not ended
        session.acting = not frame.phase.over
        return self._seen(frame), float(frame.phase is Phase.SUCCESS), ended, cut, self._told(frame)

    def close(self) -> None:
        """Close the components, and make a participant file of what was recorded."""
        self._leave()

    def _build(self) -> tuple[Rig, PolicyInput]:
        rig = Rig.build(self._study, simulated=True)
        signals = rig.input.signals
        device = PolicyInput(signals, rig.describe(self._study, 0).axes.size)
        return Rig(device, rig.controller, rig.dynamics, rig.tasks), device

    def _begin(self) -> _Session:
        plan = plan_session(self._study, self._participant, 1)
        rig, device = self._build()
        run = self._closing.enter_context(rig.opened(self._study, plan.seed))
        sequencer = Sequencer(self._study, plan, rig, waits=False)
        self._sessions += 1
        clock = ManualClock()
        log = None if self._record is None else self._journal(self._record, run)
        steps = ticks(clock, run.rate_hz)
        make_frame, frame = loop.frame_maker(rig, run, sequencer), loop.before(rig, run)
        self._session = _Session(device, sequencer, make_frame, steps, frame, log)
        return self._session

    def _journal(self, folder: Path, run: Run) -> FrameLog:
        folder.mkdir(parents=True, exist_ok=True)
        journal = SessionJournal(
            journal_path(folder, self._sessions, "run"), columns(run), run.rate_hz
        )
        study = self._study.protocol
        about: dict[str, Any] = {
            "participant": folder.name,
            "study": study.study,
            "title": study.title,
            "rate_hz": run.rate_hz,
            "simulated": True,
            "policy": True,
            "plan_of": self._participant,
            "protocol_sha256": self._study.sha256,
            "machine": self._study.machine_text,
        }
        journal.write_event(Event(START, 0.0, about), 0)
        return FrameLog(journal, run)

    def _tick(self, session: _Session, orders: tuple[Command, ...] = ()) -> Frame:
        """Pass through the loop once."""
        frame = session.make_frame(next(session.ticks), session.frame, lambda: orders, None)
        if session.log is not None:
            session.log.write(frame)
        session.frame = frame
        return frame

    def _leave(self) -> None:
        """Close the session under way, if there is one."""
        session, self._session = self._session, None
        self._closing.close()
        if session is not None and session.log is not None and self._record is not None:
            session.log.close()
            journal = journal_path(self._record, self._sessions, "run")
            consolidate(participant_path(self._record), [journal])

    def _drawn(self) -> str:
        """Return a participant of the study, drawn by the seed."""
        who = self._study.protocol.participants
        return pseudonyms(who.pattern, who.planned)[int(self.np_random.integers(who.planned))]

    def _seen(self, frame: Frame) -> FloatArray:
        return np.concatenate([frame.state, frame.task])

    def _told(self, frame: Frame) -> dict[str, Any]:
        found: dict[str, Any] = {"trial": frame.trial, "phase": str(frame.phase)}
        for event in frame.events:
            if event.name in {"trial.start", "trial.end"}:
                found |= dict(event.data)
        return found


gymnasium.register(id=ID, entry_point=f"{__name__}:StudyEnvironment")
