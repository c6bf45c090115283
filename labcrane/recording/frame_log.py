"""Frames into the journal: one row of numbers a tick, and its events."""

import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from itertools import accumulate, pairwise, starmap

import numpy as np

from labcrane.core.clock import Tick
from labcrane.core.records import Event, Frame, Phase, Run
from labcrane.core.signals import Signal
from labcrane.errors import RecordingError
from labcrane.limits import LIMITS
from labcrane.recording.data_folder import DataFolder
from labcrane.recording.journal import Column, SessionJournal
from labcrane.types import FloatArray

PHASES = tuple(Phase)
"""The phases in the order of their numbers in ``loop/phase``."""
CODES: Mapping[Phase, float] = {phase: float(code) for code, phase in enumerate(PHASES)}

LOOP = (
    Signal("tick", "1", definition="number of the tick, from 0"),
    Signal("due", "s", definition="when the tick was to begin, on the session's clock"),
    Signal("woke", "s", definition="when the tick began, on the session's clock"),
    Signal("wrote", "s", definition="how long it took to write the frame before"),
    Signal("trial", "1", definition="number of the trial under way; 0 between trials"),
    Signal("elapsed", "s", definition="time since the trial's start, without pauses"),
    Signal(
        "phase",
        "1",
        definition=", ".join(f"{code} {phase}" for code, phase in enumerate(PHASES)),
    ),
    Signal("paused", "1", definition="1 while the session is paused, else 0"),
)
"""Columns that the loop itself writes."""

DUE = 1
"""Which of them says when a tick is due."""


def columns(run: Run) -> tuple[Column, ...]:
    """Return the columns of a row, in order."""
    layouts = {"input": run.axes, "command": run.command, "state": run.state, "task": run.task}
    return (
        *(Column("loop", each.name, each.unit) for each in LOOP),
        *(
            Column(group, label, unit)
            for group, layout in layouts.items()
            for label, unit in zip(layout.columns, layout.units, strict=True)
        ),
    )


def sizes(run: Run) -> tuple[int, int, int, int]:
    """Return how many axes, numbers of a command, of a state and of a task a frame holds."""
    return run.axes.size, run.command.size, run.state.size, run.task.size


CHUNK_BYTES = 16
"""Bytes that the journal adds to a frame, about."""


def frame_bytes(run: Run) -> int:
    """Return how much a frame adds to the journal, in bytes."""
    return 8 * len(columns(run)) + CHUNK_BYTES


class FrameRow:
    """Puts frames into rows of numbers, in the order of :func:`columns`, and takes them out again.

    Parameters
    ----------
    sizes
        How many axes, numbers of a command, of a state and of a task a frame holds.
    wrote
        Whether rows say how long writing the frame before took; a stream of frames does not.
    """

    def __init__(self, sizes: Iterable[int], *, wrote: bool = True) -> None:
        self._head = len(LOOP) if wrote else len(LOOP) - 1
        ends = list(accumulate(sizes, initial=self._head))
        self._axes, self._command, self._state, self._task = starmap(slice, pairwise(ends))
        self._wrote = wrote
        self.size = ends[-1]

    def fill(self, row: FloatArray, frame: Frame, wrote: float = 0.0) -> None:
        """Fill ``row``; ``wrote`` is how long writing the frame before took, in seconds."""
        phase = CODES[frame.phase]
        trial, elapsed, paused = frame.trial, frame.elapsed, frame.paused
        if self._wrote:
            row[: self._head] = (*frame.tick, wrote, trial, elapsed, phase, paused)
        else:
            row[: self._head] = (*frame.tick, trial, elapsed, phase, paused)
        row[self._axes] = frame.axes
        row[self._command] = frame.command
        row[self._state] = frame.state
        row[self._task] = frame.task

    def frame(self, row: FloatArray) -> Frame:
        """Return the frame that a row holds, shape ``(n_columns,)``; its arrays are views of it."""
        number, due, woke, *_, trial, elapsed, phase, paused = row[: self._head].tolist()
        return Frame(
            Tick(int(number), due, woke),
            elapsed,
            row[self._axes],
            row[self._command],
            row[self._state],
            row[self._task],
            PHASES[int(phase)],
            int(trial),
            bool(paused),
        )


AROUND_A_FRAME = 500
"""Bytes that a frame takes in memory in addition to its numbers."""


class FrameLog:
    """Writes frames through to the journal, each before any other part sees it.

    When the disk refuses, frames wait in memory, in order, and are written as soon as it takes
    them again: while ``trouble`` is set, no data that matter should be produced.

    Parameters
    ----------
    reserve
        Free bytes below which the disk counts as full: before the first byte is lost.

    Attributes
    ----------
    trouble
        Why the disk cannot be trusted now, in words; None while all is well.
    """

    def __init__(self, journal: SessionJournal, run: Run, reserve: int = 0) -> None:
        self.trouble: str | None = None
        self._journal = journal
        self._reserve = reserve
        self._row = np.empty(len(columns(run)))
        self._fill = FrameRow(sizes(run)).fill
        self._wrote = 0.0
        self._waiting: deque[Callable[[], None]] = deque()
        self._over = ""
        self._most = LIMITS["frames waiting for a disk"].most // (self._row.nbytes + AROUND_A_FRAME)

    def write(self, frame: Frame) -> None:
        """Write one frame and its events; when this returns, the operating system has them.

        Raises
        ------
        RecordingError
            The disk has refused for so long that no more can wait in memory.
        """
        began = time.perf_counter()
        row, tick = self._row, frame.tick
        self._fill(row, frame, self._wrote)
        if self._waiting or not self._through(frame, row):
            if len(self._waiting) >= self._most:
                self._over = self._too_many()
                raise RecordingError(self._over)
            self._waiting.append(partial(self._journal.write_frame, tick.due, row.copy()))
            self._write_events(frame)
        if not self._waiting:
            free = self._journal.free
            self.trouble = None if free >= self._reserve else self._nearly_full(free)
        self._wrote = time.perf_counter() - began

    def note(self, event: Event, tick: int = 0) -> None:
        """Write an event that is in no frame: before the first, or at the end.

        Raises
        ------
        RecordingError
            The disk refuses it.
        """
        self._journal.write_event(event, tick)

    def append(self, event: Event, tick: int) -> None:
        """Write an event that was found out after ``tick``; it waits as frames do."""
        self._waiting.append(partial(self._journal.write_event, event, tick))
        self._catch_up()

    def close(self) -> None:
        """Write the waiting data, if the disk takes them now, and close the journal.

        Raises
        ------
        RecordingError
            The disk still refuses; says how much could not be written.
        """
        self._catch_up()
        lost = len(self._waiting)
        try:
            self._journal.close()
        except RecordingError as error:
            if not lost:
                raise
            error.add_note(self._not_written(lost))
            raise
        if lost:
            raise RecordingError(self._not_written(lost))

    def _too_many(self) -> str:
        return (
            f"{len(self._waiting)} frames and events wait for the disk, and no more can: "
            f"{self.trouble}; the session ends: repair the disk, then run labcrane resume "
            f"{DataFolder.options(self._journal.path.parent.name)}"
        )

    def _not_written(self, lost: int) -> str:
        if self._over:
            return f"{self._over}; the earlier data are in {self._journal.path}"
        return (
            f"{lost} frames and events could not be written: {self.trouble}; the earlier ones are "
            f"in {self._journal.path}"
        )

    def _through(self, frame: Frame, row: FloatArray) -> bool:
        """Write at once; whether the frame went in. Its events wait if they alone did not."""
        try:
            self._journal.write_frame(frame.tick.due, row)
        except RecordingError as error:
            self.trouble = str(error)
            return False
        self._write_events(frame)
        return True

    def _write_events(self, frame: Frame) -> None:
        for event in frame.events:
            self._waiting.append(partial(self._journal.write_event, event, frame.tick.number))
        self._catch_up()

    def _catch_up(self) -> None:
        while self._waiting:
            try:
                self._waiting[0]()
            except RecordingError as error:
                self.trouble = str(error)
                return
            except Exception:
                self._waiting.popleft()  # a plugin's mistake, which no later attempt makes good
                raise
            self._waiting.popleft()

    def _nearly_full(self, free: int) -> str:
        return (
            f"only {free / 1e6:.0f} MB are free for {self._journal.path}, and "
            f"{self._reserve / 1e6:.0f} MB are kept in reserve; free some space"
        )


FRAMES = 4096
"""Frames in one chunk of the journal."""


class BatchLog(FrameLog):
    """Writes the frames of a simulation; one that is killed can be repeated, to the same bits.

    So frames wait in memory until their chunk is full, and nothing measures how long writing takes.
    An error of the disk ends the simulation.
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

    @property
    def room(self) -> FloatArray:
        """Rows of the chunk that are still empty, shape ``(n, n_columns)``; to be filled."""
        return self._rows[self._count :]

    def made(self, count: int) -> None:
        """Keep the first rows of :attr:`room`, which have been filled."""
        end = self._count + count
        self._stamps[self._count : end] = self._rows[self._count : end, DUE]
        self._count = end
        if end == FRAMES:
            self._flush()

    def close(self) -> None:
        """Write the waiting data, and close the journal."""
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
