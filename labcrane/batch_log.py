"""Frames of a simulation into the journal, many at a time."""

import numpy as np

from labcrane.frame_log import FrameLog, columns
from labcrane.recording.journal import SessionJournal
from labcrane.records import Event, Frame, Run

FRAMES = 4096
"""Frames in one chunk of the journal."""


class BatchLog(FrameLog):
    """Writes what nobody would miss: a simulation that is killed is made again, to the same bits.

    So frames wait in memory for their chunk to be full, and nothing measures how long writing
    takes. A disk that refuses ends the simulation.
    """

    def __init__(self, journal: SessionJournal, run: Run) -> None:
        super().__init__(journal, run)
        self._stamps = np.empty(FRAMES)
        self._rows = np.empty((FRAMES, len(columns(run))))
        self._count = 0
        self._events: list[tuple[Event, int]] = []

    def write(self, frame: Frame) -> None:
        """Keep one frame and its events for the next chunk."""
        count, tick = self._count, frame.tick
        self._fill(self._rows[count], frame, 0.0)
        self._stamps[count] = tick.due
        self._count = count + 1
        if frame.events:
            self._events += [(event, tick.number) for event in frame.events]
        if self._count == FRAMES:
            self._flush()

    def close(self) -> None:
        """Write what waits, and close the journal."""
        try:
            self._flush()
        finally:
            super().close()

    def _flush(self) -> None:
        self._journal.write_frames(self._stamps[: self._count], self._rows[: self._count])
        self._count = 0
        for event, number in self._events:
            self._journal.write_event(event, number)
        self._events.clear()
