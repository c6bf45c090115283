"""Measurement of the delay of a view, a sound or a vibration, by a sensor's LSL stream."""

import random
import time
from collections.abc import Callable
from dataclasses import replace
from datetime import date
from typing import TYPE_CHECKING

import numpy as np

from labcrane.core.clock import Tick
from labcrane.core.records import Frame, Phase, Run, SessionState
from labcrane.errors import ProtocolError, StreamError
from labcrane.feedback.config import FeedbackConfig
from labcrane.feedback.delays import MeasuredDelay
from labcrane.feedback.presenter import Presenter
from labcrane.feedback.processes import host_orders
from labcrane.protocol.rig import Rig
from labcrane.protocol.study import Study
from labcrane.registry.registry import discover
from labcrane.streams.edges import Change, Kind, delay, onsets, steps
from labcrane.streams.newest import NewestSample

if TYPE_CHECKING:
    from labcrane.streams.feedback_log import FeedbackLog

GAP_S = (0.22, 0.41)
"""Shortest and longest time between two changes: random, to avoid step with a refresh rate."""

PULL_S = 0.004
SETTLE_S = 0.3
LATE_S = 0.5
"""How long the sensor is recorded after the last change."""

WAIT_S = 10.0
"""How long the sensor's stream is searched for."""

SIDE_M = 0.4
"""How far the tip is from the target for which a sound is made, in metres."""


class Sensor:
    """One channel of a stream: photodiode, microphone or accelerometer, on our clock."""

    def __init__(self, name: str, channel: int) -> None:
        self._stream = NewestSample({"name": name}, buffer_s=60)
        if not self._stream.wait(WAIT_S) or self._stream.info is None:
            self._stream.close()
            raise StreamError(
                f"there is no stream {name!r}; labcrane streams lists those that there are"
            )
        if not 1 <= channel <= (there := self._stream.info.channel_count()):
            self._stream.close()
            raise StreamError(f"stream {name!r} has no channel {channel}; it has {there}")
        self._channel = channel - 1
        self._offsets = [self._stream.clock(WAIT_S).offset]
        self._times: list[float] = []
        self._values: list[float] = []

    @property
    def sends(self) -> bool:
        """Whether any sample has come."""
        return bool(self._times)

    def pull(self, wait_s: float) -> None:
        """Take the samples that have come; wait for the first one."""
        deadline = time.monotonic() + wait_s
        while not (found := self._stream.pull())[1] and time.monotonic() < deadline:
            time.sleep(PULL_S)
        samples, times = found
        self._times += times
        self._values += [sample[self._channel] for sample in samples]

    def signal(self) -> tuple["np.ndarray", "np.ndarray", float]:
        """Return times in s on our clock, values, and samples per second."""
        self._offsets.append(self._stream.clock(WAIT_S).offset)
        times = np.array(self._times) + float(np.mean(self._offsets))
        rate = (len(times) - 1) / (times[-1] - times[0])
        return times, np.array(self._values), float(rate)


class DelayStage:
    """Presents one frame repeatedly, and changes it on request."""

    def __init__(self, order: FeedbackConfig, frame: Frame, kind: Kind, event: str) -> None:
        self._kind, self._event, self._frame = kind, event, frame
        self._presenter = Presenter(order, discover(study=order.study))
        self._name = order.name
        self._count = self._number = 0
        self._order = order
        self.facts = self._presenter.feedback.metadata
        self._log: FeedbackLog | None = None

    def open(self) -> None:
        """Open the window or the sound device."""
        from labcrane.streams.feedback_log import FeedbackLog  # noqa: PLC0415 - liblsl

        self._presenter.open()
        self._log = FeedbackLog(self._name, self._order.source, self._presenter)
        columns = self._presenter.layout.columns
        self._flip = columns.index("flip.time") if "flip.time" in columns else None

    def close(self) -> None:
        """Close it."""
        self._presenter.close()

    def change(self) -> None:
        """Change the patch, or begin or end the sound, with the next frame."""
        self._count += 1
        if self._kind == "display":
            now = SessionState(trial=1, counts={self._event: self._count})
        else:
            now = SessionState(trial=1, active=(self._name,) if self._count % 2 else ())
        self._presenter.update(now)

    def present(self) -> float | None:
        """Present the frame; return its time, None for silence."""
        self._number += 1
        now = time.perf_counter()
        frame = replace(self._frame, tick=Tick(self._number, now, now))
        values = self._presenter.present(frame)
        if values is None or self._log is None:
            return None
        stamp = self._log.push(frame, values, 0, self._presenter.feedback.samples())
        return stamp if self._flip is None else float(values[self._flip])


def measure(
    study: Study,
    kind: Kind,
    name: str,
    stream: str,
    count: int,
    channel: int = 1,
    say: Callable[[str], None] = lambda text: None,
) -> MeasuredDelay:
    """Measure the delay of the view, sound or vibration ``name``.

    Parameters
    ----------
    kind
        What the sensor notices.
    stream, channel
        The sensor's stream, and the number of its channel, from 1.
    count
        Number of presented changes.
    say
        Reports progress.

    Raises
    ------
    ProtocolError, StreamError, DeviceError
        It cannot be measured.
    """
    event = _patch_event(study, name) if kind == "display" else ""
    built = Rig.build(study, simulated=True)
    with built.opened(study, 0) as run:
        (order,) = (each for each in host_orders(study, run, "doctor") if each.name == name)
        order = replace(order, cues={}, always=kind == "display")
        frame = _frame(run, built.dynamics.state().copy())
    sensor = Sensor(stream, channel)
    stage = DelayStage(order, frame, kind, event)
    try:
        stage.open()
        say(f"measuring {name!r} with {stream!r}: {count} changes")
        changes = _changes(stage, sensor, kind, count)
        facts = {key: value for key, value in stage.facts().items() if key != "delay"}
    finally:
        stage.close()
    times, values, rate = sensor.signal()
    seen = steps(times, values) if kind == "display" else onsets(times, values)
    found = delay(changes, seen, rate)
    return MeasuredDelay(kind, date.today().isoformat(), stream, found, facts)


def _patch_event(study: Study, name: str) -> str:
    """Return the event at which the patch of a view changes."""
    patch = getattr(study.views[name].settings, "patch", None)
    if patch is None:
        raise ProtocolError(
            f"view {name!r} has no patch for a photodiode; write patch: {{}} under it"
        )
    return str(patch.on[0])


def _frame(run: Run, state: "np.ndarray") -> Frame:
    """Return a frame in which the machine stands still beside a target."""
    task = np.zeros(run.task.size)
    columns = run.task.columns
    if "target.position.x" in columns:
        tip = state[run.state.find("tip.position")]
        task[run.task.find("target.position")] = tip + np.array([SIDE_M, 0.0, 0.0])
    if "target.radius" in columns:
        task[run.task.index("target.radius")] = SIDE_M / 2.0
    return Frame(
        Tick(0, 0.0, 0.0),
        0.0,
        np.zeros(run.axes.size),
        np.zeros(run.command.size),
        state,
        task,
        Phase.RUNNING,
        trial=1,
    )


def _changes(stage: DelayStage, sensor: Sensor, kind: Kind, count: int) -> list[Change]:
    """Make the changes; return those that a sensor should see."""
    gaps = random.Random(0)  # noqa: S311 - only to be out of step with any refresh rate
    # The first pictures take long, and so does a sensor's program that has only just been found.
    started = time.perf_counter()
    while not sensor.sends or time.perf_counter() < started + SETTLE_S:
        stage.present()
        sensor.pull(PULL_S)
        if time.perf_counter() > started + WAIT_S:
            raise StreamError(
                f"the sensor's stream has sent nothing for {WAIT_S:g} s; is its program running?"
            )
    changes = []
    for number in range(1, (1 if kind == "display" else 2) * count + 1):
        until = time.perf_counter() + gaps.uniform(*GAP_S)
        while time.perf_counter() < until:
            stage.present()
            sensor.pull(PULL_S)
        stage.change()
        stamp = stage.present()
        if stamp is not None:
            changes.append(Change(stamp, up=kind != "display" or bool(number % 2)))
    until = time.perf_counter() + LATE_S
    while time.perf_counter() < until:
        sensor.pull(PULL_S)
    return changes
