"""Frames of a recorded session by number, as they were in the loop."""

import numpy as np

from labcrane.core.records import Event, Frame
from labcrane.core.signals import Layout, signals_of
from labcrane.recording.frame_log import LOOP, FrameRow
from labcrane.recording.participant_file.reader import SessionRecord

GROUPS = ("input", "command", "state", "task")
WINDOW = 4096
"""Rows that are read at once: an hour is never held in memory."""


class RecordedFrames:
    """The frames of a recorded session by number, with the events of each."""

    def __init__(self, record: SessionRecord) -> None:
        self._streams = {name: record.streams[name] for name in ("loop", *GROUPS)}
        self.time = self._streams["loop"].time
        units = self._streams["input"].units
        self.axes = Layout("the input", signals_of(list(units), units))
        self._frame = FrameRow(len(self._streams[name].units) for name in GROUPS).frame
        self._events: dict[int, list[Event]] = {}
        table = record.events
        ticks = table["tick"].to_numpy()
        for tick, name, at, data in zip(
            ticks, table["name"], table["time"], table["data"], strict=True
        ):
            self._events.setdefault(int(tick), []).append(Event(str(name), float(at), data))
        self._ticks = sorted(self._events)
        self._first, self._rows = 0, np.empty((0, 0))

    def frame(self, row: int) -> Frame:
        """Return the frame in a row."""
        if not self._first <= row < self._first + len(self._rows):
            parts = [self._streams[name].rows(row, row + WINDOW) for name in self._streams]
            head, others = parts[0], parts[1:]
            columns = [head[label] for label, _ in LOOP]
            columns += [values for part in others for values in part.values()]
            self._first, self._rows = row, np.column_stack(columns)
        frame: Frame = self._frame(self._rows[row - self._first])
        return frame

    def events(self, first: int, last: int) -> list[Event]:
        """Return what happened after tick ``first``, up to tick ``last``."""
        return [one for tick in self._ticks if first < tick <= last for one in self._events[tick]]
