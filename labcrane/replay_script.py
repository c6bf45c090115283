"""What entered a recorded session from outside, tick by tick."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from labcrane.clock import Tick
from labcrane.console import Command, Order
from labcrane.recording.recording import SessionRecord
from labcrane.records import Event, Frame
from labcrane.roles import InputDevice
from labcrane.signals import FloatArray, Signal


class RecordOver(Exception):  # noqa: N818 - ends a loop, and is no error
    """The last recorded tick has been run."""


class RecordedAxes(InputDevice):
    """Gives each tick what was recorded in it."""

    def __init__(self, signals: tuple[Signal, ...], axes: FloatArray) -> None:
        self.signals = signals
        self._axes = axes
        self.faults: list[tuple[int, str | None]] = []

    def read(self, tick: Tick, seen: Frame) -> FloatArray:
        if tick.number == len(self._axes):
            raise RecordOver
        while self.faults and self.faults[0][0] <= tick.number:
            self.fault = self.faults.pop(0)[1]
        row: FloatArray = self._axes[tick.number]
        return row


class Script:
    """Everything that entered the loop from outside, tick by tick; also the console."""

    def __init__(self, record: SessionRecord) -> None:
        recorded = record.streams["input"]
        axes = recorded.data.to_numpy(np.float64)
        self.input = RecordedAxes(signals_of(list(map(str, recorded.data)), recorded.units), axes)
        self.ticks = len(axes)
        self.start = float(record.streams["loop"].data["due"].iloc[0])
        self.disk_trouble: str | None = None
        self._disk: dict[int, str | None] = {}
        self._orders: dict[int, list[Command]] = {}
        self._tick = -1
        events = record.events
        for tick, name, data in zip(events["tick"], events["name"], events["data"], strict=True):
            self._take(int(tick), str(name), data)

    def _take(self, tick: int, name: str, data: Mapping[str, Any]) -> None:
        """Note what an event says came from outside."""
        part, _, what = name.rpartition(".")
        if part == "order":
            self._order(tick, Command(Order(what), data.get("text", "")))
        elif part == "stream" and what in {"lost", "back"}:
            self._order(tick, Command(Order(what), data["what"]))
        elif part == "feedback" and what == "lost":
            self._order(tick, Command(Order.FAILED, f"{data['what']}: {data['why']}"))
        elif part == "feedback" and what == "ready":
            self._order(tick, Command(Order.MENDED, f"{data['what']}: {data['facts']}"))
        elif part == "input" and what in {"lost", "back"}:
            self.input.faults.append((tick, data.get("why")))
        elif part == "disk" and what in {"lost", "back"}:
            self._disk[tick] = data.get("why")

    def _order(self, tick: int, command: Command) -> None:
        self._orders.setdefault(tick, []).append(command)

    def commands(self) -> list[Command]:
        """Return the orders of this tick."""
        self._tick += 1
        self.disk_trouble = self._disk.get(self._tick, self.disk_trouble)
        return self._orders.get(self._tick, [])

    def report(self, event: Event) -> None:
        """Nobody is told; the sinks see every event."""


def signals_of(names: Sequence[str], units: Mapping[str, str]) -> tuple[Signal, ...]:
    """Return signals with these columns, in the same order."""
    signals: list[Signal] = []
    for column in names:
        name, _, component = column.rpartition(".")
        if name and signals and signals[-1].name == name:
            last = signals.pop()
            signals.append(Signal(name, last.unit, (*last.components, component)))
        elif name:
            signals.append(Signal(name, units[column], (component,)))
        else:
            signals.append(Signal(column, units[column]))
    return tuple(signals)
