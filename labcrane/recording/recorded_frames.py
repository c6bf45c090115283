"""Frames of a recorded session by number, as they were in the loop."""

from bisect import bisect_right
from typing import TYPE_CHECKING

import numpy as np

from labcrane.core.records import Event, Frame
from labcrane.core.signals import Layout, signals_of
from labcrane.recording.frame_log import LOOP, FrameRow
from labcrane.recording.participant_file.reader import SessionRecord

if TYPE_CHECKING:
    import numpy.typing as npt

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
        events = record.events.assign(row=self._rows_of(record))
        events = events.sort_values("row", kind="stable")
        self._told = events["row"].tolist()
        self._events = [
            Event(str(name), float(at), data)
            for name, at, data in zip(events["name"], events["time"], events["data"], strict=True)
        ]
        self._first, self._rows = 0, np.empty((0, 0))

    def _rows_of(self, record: SessionRecord) -> "npt.NDArray[np.intp]":
        """Return the row of each event's frame; ticks restart in each part of a session."""
        events = record.events
        begins = events.groupby("part")["time"].first()
        first = dict(zip(begins.index, np.searchsorted(self.time, begins), strict=True))
        last = dict(zip(begins.index, [*list(first.values())[1:], len(self.time)], strict=True))
        ticks = self._streams["loop"].column("tick")
        rows = [
            first[part] + np.searchsorted(ticks[first[part] : last[part]], tick)
            for part, tick in zip(events["part"], events["tick"], strict=True)
        ]
        ends = events["part"].map(last).to_numpy()
        return np.asarray(np.maximum(np.minimum(rows, ends - 1), 0))

    def frame(self, row: int) -> Frame:
        """Return the frame in a row."""
        if not self._first <= row < self._first + len(self._rows):
            parts = [self._streams[name].rows(row, row + WINDOW) for name in self._streams]
            head, others = parts[0], parts[1:]
            columns = [head[each.name] for each in LOOP]
            columns += [values for part in others for values in part.values()]
            self._first, self._rows = row, np.column_stack(columns)
        frame: Frame = self._frame(self._rows[row - self._first])
        return frame

    def events(self, first: int, last: int) -> list[Event]:
        """Return the events after the frame in row ``first``, up to that in row ``last``."""
        return self._events[bisect_right(self._told, first) : bisect_right(self._told, last)]
