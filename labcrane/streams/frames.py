"""Frames as one LSL stream, for the views and sounds that present them.

A sample of ``labcrane.frame`` is everything a frame holds but its events, in float64: the columns
of :func:`frame_columns`, in order. Its time is the time the tick was due.
"""

import time
from typing import TYPE_CHECKING

import numpy as np

from labcrane.core.records import Frame, Run
from labcrane.recording.frame_log import FrameRow, columns, sizes
from labcrane.recording.journal import Column
from labcrane.streams.outlets import SampleOutlet, channel, stream_info
from labcrane.types import FloatArray

if TYPE_CHECKING:
    import pylsl

FRAME = "labcrane.frame"


def frame_columns(run: Run) -> tuple[Column, ...]:
    """Return what a sample holds, in order: the columns of the journal but for ``wrote``."""
    return tuple(each for each in columns(run) if (each.group, each.label) != ("loop", "wrote"))


class FrameOutlet:
    """Sends every frame whole."""

    def __init__(self, run: Run, source: str) -> None:
        held = frame_columns(run)
        info = stream_info(
            FRAME, "Frame", len(held), "double64", rate_hz=run.rate_hz, source=source
        )
        for column in held:
            channel(info, label=_label(column), unit=column.unit, type="Frame")
        self._row = np.zeros(len(held))
        self._fill = FrameRow(sizes(run), wrote=False).fill
        self._samples = SampleOutlet(info, len(held))

    @property
    def description(self) -> str:
        """The stream as XML: a reader that has it needs no search."""
        return self._samples.description

    def push(self, frame: Frame) -> None:
        """Send a frame. Does not wait for any receiver."""
        self._fill(self._row, frame)
        self._samples.push(self._row, frame.tick.due)

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
            info, max_buflen=self.BUFFER_S, recover=False, processing_flags=0, as_numpy=True
        )
        self._frame = FrameRow(sizes(run), wrote=False).frame
        self.skipped = 0

    def newest(self, wait_s: float) -> Frame | None:
        """Return the newest frame, waiting up to ``wait_s`` for one; None when none came."""
        import pylsl  # noqa: PLC0415

        try:
            row = self._pulled(wait_s)
        except pylsl.util.LostError:  # the session has ended, and this process is about to
            time.sleep(wait_s)
            return None
        return None if row is None else self._frame(row)

    def _pulled(self, wait_s: float) -> FloatArray | None:
        row, _ = self._inlet.pull_sample(timeout=wait_s)
        if row is None:
            return None
        while True:
            rows, _ = self._inlet.pull_chunk(timeout=0.0, max_samples=1024)
            if not len(rows):
                return np.asarray(row, dtype=np.float64)
            self.skipped += len(rows)
            row = rows[-1]


def _label(column: Column) -> str:
    """Return a channel's label: those of the loop stand alone, as ``tick``."""
    if column.group == "loop":
        return column.label
    return f"{'axes' if column.group == 'input' else column.group}.{column.label}"
