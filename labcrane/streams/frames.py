"""Frames as one LSL stream, for whoever presents them.

A sample of ``labcrane.frame`` is everything a frame holds but its events, in float64: the columns
of :func:`frame_columns`, in order. Its time is the time the tick was due.
"""

import itertools
from typing import TYPE_CHECKING

import numpy as np

from labcrane.core.clock import Tick
from labcrane.core.records import Frame, Phase, Run
from labcrane.core.signals import Layout
from labcrane.streams.outlets import Samples, channel, stream_info
from labcrane.types import FloatArray

if TYPE_CHECKING:
    import pylsl

FRAME = "labcrane.frame"

HEAD = ("tick", "due", "woke", "elapsed", "trial", "phase", "paused")
HEAD_UNITS = ("1", "s", "s", "s", "1", "1", "1")
PHASES = tuple(Phase)
"""What the numbers in the phase column stand for."""


def layouts(run: Run) -> tuple[Layout, Layout, Layout, Layout]:
    """Return the layouts of a frame's arrays: axes, command, state, task."""
    return run.axes, run.command, run.state, run.task


def frame_columns(run: Run) -> tuple[str, ...]:
    """Return what a sample holds, in order."""
    parts = zip(("axes", "command", "state", "task"), layouts(run), strict=True)
    return (*HEAD, *(f"{part}.{column}" for part, layout in parts for column in layout.columns))


class FrameOutlet:
    """Sends every frame whole."""

    def __init__(self, run: Run, source: str) -> None:
        columns = frame_columns(run)
        info = stream_info(
            FRAME, "Frame", len(columns), "double64", rate_hz=run.rate_hz, source=source
        )
        units = (*HEAD_UNITS, *(unit for layout in layouts(run) for unit in layout.units))
        for column, unit in zip(columns, units, strict=True):
            channel(info, label=column, unit=unit, type="Frame")
        self._row = np.zeros(len(columns))
        self._samples = Samples(info, len(columns))

    @property
    def description(self) -> str:
        """The stream as XML: whoever has it needs no search."""
        return self._samples.description

    def push(self, frame: Frame) -> None:
        """Send a frame. Does not wait for any receiver."""
        row, start = self._row, len(HEAD)
        row[:3] = frame.tick
        row[3:start] = frame.elapsed, frame.trial, PHASES.index(frame.phase), frame.paused
        for array in (frame.axes, frame.command, frame.state, frame.task):
            row[start : start + len(array)] = array
            start += len(array)
        self._samples.push(row, frame.tick.due)

    def close(self) -> None:
        """End the stream."""
        self._samples.close()


class FrameInlet:
    """Receives frames; gives the newest one and counts those that it replaces.

    Parameters
    ----------
    info
        The stream, as it was found.

    Attributes
    ----------
    skipped
        How many frames were never given because a newer one had come.
    """

    BUFFER_S = 2
    """A receiver that hangs must not keep more than this in memory."""

    def __init__(self, info: "pylsl.StreamInfo", run: Run) -> None:
        import pylsl  # noqa: PLC0415 - liblsl reads its configuration when it is loaded

        self._inlet = pylsl.StreamInlet(
            info, max_buflen=self.BUFFER_S, recover=True, processing_flags=0, as_numpy=True
        )
        self._sizes = [layout.size for layout in layouts(run)]
        self.skipped = 0

    def newest(self, wait_s: float) -> Frame | None:
        """Return the newest frame, waiting up to ``wait_s`` for one; None when none came."""
        row, _ = self._inlet.pull_sample(timeout=wait_s)
        if row is None:
            return None
        while True:
            rows, _ = self._inlet.pull_chunk(timeout=0.0, max_samples=1024)
            if not len(rows):
                break
            self.skipped += len(rows)
            row = rows[-1]
        return frame_of(np.asarray(row, dtype=np.float64), self._sizes)


def frame_of(row: FloatArray, sizes: list[int]) -> Frame:
    """Return the frame that a sample holds, shape ``(n_columns,)``."""
    number, due, woke, elapsed, trial, phase, paused = row[: len(HEAD)].tolist()
    ends = np.cumsum([len(HEAD), *sizes])
    axes, command, state, task = (row[a:b] for a, b in itertools.pairwise(ends))
    return Frame(
        Tick(int(number), due, woke),
        elapsed,
        axes,
        command,
        state,
        task,
        PHASES[int(phase)],
        int(trial),
        bool(paused),
    )
