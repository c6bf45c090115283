"""Estimates in a run: the newest values of each, recorded with the axes of the input.

They enter the loop as axes do, so that a replay needs no estimate.
"""

import math
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import replace
from enum import IntEnum

import numpy as np

from labcrane.core.by_estimate import OF_ESTIMATE
from labcrane.core.clock import Tick
from labcrane.core.records import Frame, Phase, Run, Trial, TrialStatus, Value
from labcrane.core.roles import InputDevice, SecondaryTask
from labcrane.core.settings import EstimateSettings
from labcrane.core.signals import Layout, Signal
from labcrane.recording.own_streams import ESTIMATED
from labcrane.types import FloatArray

MOST_A_TICK = 64

AHEAD_S = 0.05
"""How far ahead of now a value's time may be: by as much as a source's clock may be off."""


class State(IntEnum):
    """State of an estimate; with any but ``OK`` its fallback is used."""

    OK = 0
    WARMING_UP = 1
    NO_DATA = 2
    NOT_A_NUMBER = 3
    LATE = 4
    AHEAD = 5


WORDS: Mapping[State, str] = {
    State.WARMING_UP: "too few samples have come",
    State.NO_DATA: "no data come",
    State.NOT_A_NUMBER: "a value is not a number",
    State.LATE: "its newest value is too old",
    State.AHEAD: "the time of its newest value is still to come",
}


def estimate_signals(name: str, settings: EstimateSettings) -> tuple[Signal, ...]:
    """Return what is recorded of an estimate in each tick.

    Its values as they are used, the time they stand for and its state.
    """
    own = OF_ESTIMATE + name
    as_used = "value as it is used: the fallback in every state but 0"
    states = ", ".join(f"{each.value} {each.name.lower().replace('_', ' ')}" for each in State)
    return (
        *(Signal(f"{own}.{value}", "", definition=as_used) for value in settings.values),
        Signal(f"{own}.time", "s", definition="time that the newest value stands for"),
        Signal(f"{own}.state", "1", definition=f"state of the estimate: {states}"),
    )


class TrialMeans(SecondaryTask):
    """The mean of each value of an estimate over a trial, of the ticks that had a value.

    It runs beside every task, so that its results are columns of the trial table, and a track can
    choose by them.
    """

    def __init__(self, name: str, settings: EstimateSettings) -> None:
        self._own, self._values = OF_ESTIMATE + name, settings.values
        self.results = tuple(
            Signal(value, "", definition=f"mean of the estimate {name}.{value} over the trial")
            for value in settings.values
        )
        self._sum, self._ticks = np.zeros(len(settings.values)), 0

    def open(self, run: Run) -> None:
        self._places = [run.axes.index(f"{self._own}.{value}") for value in self._values]
        self._state = run.axes.index(f"{self._own}.state")

    def begin_trial(self, trial: Trial) -> None:
        self._sum[:], self._ticks = 0.0, 0

    def evaluate(self, frame: Frame) -> TrialStatus:
        if frame.axes[self._state] == State.OK:
            self._sum += frame.axes[self._places]
            self._ticks += 1
        return TrialStatus(Phase.RUNNING, np.empty(0))

    def measure(self) -> Mapping[str, Value]:
        means = self._sum / self._ticks if self._ticks else [None] * len(self._values)
        return {
            name: mean if mean is None else float(mean)
            for name, mean in zip(self._values, means, strict=True)
        }


def trial_means(estimates: Mapping[str, EstimateSettings]) -> dict[str, SecondaryTask]:
    """Return what measures estimates by trial, by the protocol's names."""
    return {name: TrialMeans(name, each) for name, each in estimates.items()}


class Received:
    """The newest values of one estimate, as its process sends them."""

    def __init__(self, name: str, settings: EstimateSettings, source: str) -> None:
        from labcrane.streams.newest import NewestSample  # noqa: PLC0415 - loads liblsl
        from labcrane.streams.outlets import source_id  # noqa: PLC0415

        self._size, self._oldest = len(settings.values), settings.at_most_age_s
        self._stream = NewestSample({"source_id": source_id(source, ESTIMATED + name)})
        self._row: FloatArray | None = None
        self._time, self._state = math.nan, State.NO_DATA

    def fill(self, out: FloatArray, now: float) -> None:
        """Write values, time and state at ``now`` over the fallback, time and state in ``out``."""
        samples, stamps = self._stream.pull(MOST_A_TICK)
        if stamps:
            self._row = np.array(samples[-1])
            self._state = State(int(self._row[-1]))
            if self._state in {State.OK, State.NOT_A_NUMBER}:
                self._time = stamps[-1]
        state = self._state
        if state is State.OK:
            age = now - self._time
            state = State.AHEAD if age < -AHEAD_S else State.LATE if age > self._oldest else state
        if state is State.OK and self._row is not None:
            out[: self._size] = self._row[: self._size]
        out[-2:] = self._time, state

    def close(self) -> None:
        """Receive no more."""
        self._stream.close()


class WithEstimates(InputDevice):
    """The operator's input device, and the estimates, which follow its axes.

    Parameters
    ----------
    source
        The session whose estimates are received; empty for none, as in a simulation on a clock of
        its own: each has its fallback.
    """

    def __init__(
        self, device: InputDevice, estimates: Mapping[str, EstimateSettings], source: str
    ) -> None:
        self._device, self._estimates, self._source = device, estimates, source
        own = [s for name, each in estimates.items() for s in estimate_signals(name, each)]
        self.signals = (*device.signals, *own)
        self._fallback = np.concatenate(
            [
                [*(each.fallback[value] for value in each.values), math.nan, State.NO_DATA]
                for each in estimates.values()
            ]
        )
        self._received: list[tuple[slice, Received]] = []

    @property
    def fault(self) -> str | None:  # type: ignore[override]  # the device's own
        """Why the device cannot be trusted now."""
        return self._device.fault

    def open(self, run: Run) -> None:
        axes = Layout("the input", self._device.signals)

        def inverse(velocity: FloatArray, state: FloatArray) -> FloatArray:
            return run.inverse(velocity, state)[: axes.size]

        self._device.open(replace(run, axes=axes, inverse=inverse))
        at = 0
        for name, settings in self._estimates.items():
            place = slice(at, at := at + len(settings.values) + 2)
            if self._source:
                self._received.append((place, Received(name, settings, self._source)))

    def begin_trial(self, trial: Trial) -> None:
        self._device.begin_trial(trial)

    def close(self) -> None:
        with ExitStack() as closing:
            closing.callback(self._device.close)
            for _, each in self._received:
                closing.callback(each.close)

    def metadata(self) -> Mapping[str, Value]:
        return self._device.metadata()

    def read(self, tick: Tick, seen: Frame) -> FloatArray:
        axes = self._device.read(tick, seen)
        values = self._fallback.copy()
        for place, each in self._received:
            each.fill(values[place], tick.woke)
        return np.concatenate([axes, values])
