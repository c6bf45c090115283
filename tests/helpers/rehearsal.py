"""A session on a clock that does not wait, with orders given at set ticks."""

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from simple_crane import CRANE

from labcrane import Frame, ProtocolError, Run
from labcrane.core import Event
from labcrane.core.clock import Clock, ManualClock
from labcrane.protocol.rig import Rig
from labcrane.session import loop
from labcrane.session.sequencer import Sequencer
from labcrane.testing import Command, Registry, Study, discover, load, main, plan_session

SHORT = (
    """\
labcrane: 1
study: rehearsal
title: A short study
rate_hz: 240
"""
    + CRANE
    + """\
tasks:
  aiming: {use: aiming, distances: [2], movements: 2}
sessions:
  - name: only
    steps:
      - block: {task: aiming, pairs: 1}
"""
)


def loaded(path: Path) -> Study:
    """Return the study of a protocol, with what is installed."""
    return load(path, discover())


def a_study(folder: Path, text: str = SHORT) -> Study:
    path = folder / "study.yaml"
    path.write_text(text, encoding="utf-8")
    return loaded(path)


def simulated_file(folder: Path, text: str) -> Path:
    """Simulate a study's first session by the command; return the participant file."""
    (folder / "study.yaml").write_text(text, encoding="utf-8")
    words = ["run", str(folder / "study.yaml"), "--participant", "P001", "--simulate", "--fast"]
    assert main([*words, "--data", str(folder / "data")]) == 0
    return folder / "data" / "P001-SIMULATED" / "P001-SIMULATED.h5"


def said_of(path: Path, text: str, registry: Registry) -> list[str]:
    """Write a protocol, and return what is said of it, without its name."""
    path.write_text(text, encoding="utf-8")
    try:
        load(path, registry)
    except ProtocolError as error:
        return str(error).replace(f"{path}:", "").splitlines()
    return []


class ScriptedConsole:
    """Gives orders at set ticks, and keeps what it is told."""

    def __init__(self, orders: Mapping[int, Sequence[Command]] | None = None) -> None:
        self._orders = orders or {}
        self._tick = -1
        self.told: list[Event] = []

    def commands(self) -> list[Command]:
        self._tick += 1
        return list(self._orders.get(self._tick, ()))

    def report(self, event: Event) -> None:
        self.told.append(event)


class StallingClock(ManualClock):
    """A clock that goes on for some seconds before the loop wakes up for a tick, as in a hang."""

    def __init__(self, stalls: Mapping[int, float], start: float = 1000.0) -> None:
        super().__init__(start)
        self._stalls = stalls
        self._tick = -1

    def wait_until(self, due: float) -> None:
        self._tick += 1
        super().wait_until(max(due, self.now()) + self._stalls.get(self._tick, 0.0))


class DiesError(Exception):
    """Stands for a process that is gone."""


class DiesInTrial(ScriptedConsole):
    """Ends everything some ticks into a trial, as a killed process does."""

    def __init__(self, trial: int, ticks: int) -> None:
        super().__init__()
        self._trial, self._left = trial, ticks

    def commands(self) -> list[Command]:
        running = [event for event in self.told if event.name == "trial.start"]
        if running and running[-1].data["trial"] == self._trial:
            self._left -= 1
        if self._left == 0:
            raise DiesError
        return []


class NoLog:
    """A log on a disk that never fails, and keeps nothing."""

    trouble = None

    def write(self, frame: Frame) -> None:
        """Nothing to do."""


@dataclass
class Rehearsal:
    """What came of a session."""

    run: Run
    frames: list[Frame] = field(default_factory=list)

    def events(self, name: str) -> list[Event]:
        return [event for frame in self.frames for event in frame.events if event.name == name]

    @property
    def names(self) -> list[str]:
        return [event.name for frame in self.frames for event in frame.events]

    def trials(self) -> list[Mapping[str, object]]:
        return [event.data for event in self.events("trial.end") if event.data["counted"]]


def rehearse(
    study: Study,
    orders: Mapping[int, Sequence[Command]] | None = None,
    *,
    waits: bool = False,
    awaits: Sequence[str] = (),
    rig: Rig | None = None,
    clock: Clock | None = None,
) -> Rehearsal:
    """Run the first session of P001 and keep every frame."""
    clock = clock or ManualClock(start=1000.0)
    plan = plan_session(study, "P001", 1)
    rig = rig or Rig.build(study, simulated=True)
    with rig.opened(study, plan.seed) as run:
        sequencer = Sequencer(study, plan, rig, waits=waits, awaits=awaits)
        seen = Rehearsal(run)
        console = ScriptedConsole(orders)
        keep = [lambda frame: seen.frames.append(copy.deepcopy(frame))]
        loop.run(rig, run, sequencer, clock, console, NoLog(), keep)
    return seen
