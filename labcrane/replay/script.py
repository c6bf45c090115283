"""Script of a recorded session: what entered it from outside, tick by tick."""

import json
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from labcrane.core.clock import ManualClock, Tick
from labcrane.core.records import Event, Frame
from labcrane.core.roles import InputDevice
from labcrane.core.signals import Signal, signals_of
from labcrane.recording.participant_file.reader import SessionRecord
from labcrane.session.commands import (
    Command,
    FeedbackLost,
    FeedbackReady,
    LauncherGone,
    Message,
    Order,
    StreamBack,
    StreamConfirmed,
    StreamLost,
)
from labcrane.session.questionnaire import SIMULATION
from labcrane.types import FloatArray

LATER = {"left_out", "attempt", "attempts"}
"""What an event of an older session may lack of a lost view or sound."""

REPORTS: Mapping[str, Callable[[Mapping[str, Any]], Message]] = {
    "stream.lost": lambda data: StreamLost(data["what"]),
    "stream.back": lambda data: StreamBack(data["what"]),
    "stream.confirmed": lambda data: StreamConfirmed(data["what"], data["which"], data["by"]),
    "feedback.lost": lambda data: FeedbackLost(
        data["what"], data["why"], **{key: data[key] for key in data.keys() & LATER}
    ),
    "feedback.ready": lambda data: FeedbackReady(data["what"], data["facts"]),
    "launcher.gone": lambda data: LauncherGone(),
}
"""The report that an event belongs to, by the event's name."""


class RecordOver(Exception):  # noqa: N818 - ends a loop and is not an error
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


class RecordedClock(ManualClock):
    """A clock that jumps, and stalls where the recorded one has stalled the session."""

    def __init__(self, start: float) -> None:
        super().__init__(start)
        self.stalls: dict[int, float] = {}
        self._tick = -1

    def wait_until(self, due: float) -> None:
        self._tick += 1
        super().wait_until(self.stalls.get(self._tick, due))


class Script:
    """Everything that entered the loop from outside, tick by tick; also the console."""

    def __init__(self, record: SessionRecord) -> None:
        recorded = record.streams["input"]
        axes = recorded.data.to_numpy(np.float64)
        self.input = RecordedAxes(signals_of(list(map(str, recorded.data)), recorded.units), axes)
        self.ticks = len(axes)
        loop = record.streams["loop"].data
        self.clock = RecordedClock(float(loop["due"].iloc[0]))
        self._woke = loop["woke"]
        self.disk_trouble: str | None = None
        self.awaited: set[str] = set()
        self._disk: dict[int, str | None] = {}
        self._orders: dict[int, list[Message]] = {}
        self._tick = -1
        events = record.events
        for tick, name, data in zip(events["tick"], events["name"], events["data"], strict=True):
            self._take(int(tick), str(name), data)

    def _take(self, tick: int, name: str, data: Mapping[str, Any]) -> None:
        """Note the outside inputs that an event reports."""
        part, _, what = name.rpartition(".")
        if name == "loop.stalled":
            self.clock.stalls[tick] = float(self._woke.iloc[tick])
        elif part == "order":
            self._order(
                tick,
                Command(Order(what), data.get("text", ""), data.get("by", ""), data.get("at", "")),
            )
        elif part == "questionnaire" and data.get("by", SIMULATION) != SIMULATION:
            self._answer(tick, what, data)
        elif name == "page.denied":
            self._order(tick, Command(Order.DENIED, data["why"], data["by"]))
        elif (report := REPORTS.get(name)) is not None:
            self._order(tick, report(data))
        elif part == "feedback" and what == "awaited":
            self.awaited.add(data["what"])
        elif part == "input" and what in {"lost", "back"}:
            self.input.faults.append((tick, data.get("why")))
        elif part == "disk" and what in {"lost", "back"}:
            self._disk[tick] = data.get("why")

    def _answer(self, tick: int, what: str, data: Mapping[str, Any]) -> None:
        """Note what was answered or handed in; a simulated participant answers again by itself."""
        if what == "answer":
            given = {name: data[name] for name in ("questionnaire", "item", "value")}
            self._order(tick, Command(Order.ANSWER, json.dumps(given), data["by"]))
        elif what == "refused" and data["given"]:
            self._order(tick, Command(Order.ANSWER, data["given"], data["by"]))
        elif (what == "refused" and not data["item"]) or (what == "end" and data["handed_in"]):
            self._order(tick, Command(Order.SUBMIT, "", data["by"]))

    def _order(self, tick: int, command: Message) -> None:
        self._orders.setdefault(tick, []).append(command)

    def commands(self) -> list[Message]:
        """Return the orders of this tick."""
        self._tick += 1
        self.disk_trouble = self._disk.get(self._tick, self.disk_trouble)
        return self._orders.get(self._tick, [])

    def report(self, event: Event) -> None:
        """Do nothing: no person watches, and the sinks see every event."""
