"""Frames into the journal: one row of numbers a tick, and the events beside it."""

import time
from collections.abc import Mapping

import numpy as np

from labcrane.recording.journal import Column, SessionJournal
from labcrane.records import Event, Frame, Phase, Run

PHASES: Mapping[Phase, float] = {phase: float(code) for code, phase in enumerate(Phase)}
"""The number that stands for a phase in ``loop/phase``."""

LOOP = (
    ("tick", "1"),
    ("due", "s"),
    ("woke", "s"),
    ("wrote", "s"),  # how long writing the frame before took
    ("trial", "1"),
    ("elapsed", "s"),
    ("phase", "1"),
    ("paused", "1"),
)


def columns(run: Run) -> tuple[Column, ...]:
    """Return what a row holds, in order."""
    layouts = {"input": run.axes, "command": run.command, "state": run.state, "task": run.task}
    return (
        *(Column("loop", label, unit) for label, unit in LOOP),
        *(
            Column(group, label, unit)
            for group, layout in layouts.items()
            for label, unit in zip(layout.columns, layout.units, strict=True)
        ),
    )


class FrameLog:
    """Writes frames through to the journal, each before anybody else sees it."""

    def __init__(self, journal: SessionJournal, run: Run) -> None:
        self._journal = journal
        self._row = np.empty(len(columns(run)))
        start = len(LOOP)
        self._slices = []
        for layout in (run.axes, run.command, run.state, run.task):
            self._slices.append(slice(start, start + layout.size))
            start += layout.size
        self._axes, self._command, self._state, self._task = self._slices
        self._wrote = 0.0

    def write(self, frame: Frame) -> None:
        """Write one frame and its events; when this returns, the operating system has them."""
        began = time.perf_counter()
        row, tick = self._row, frame.tick
        row[0], row[1], row[2] = tick
        row[3:8] = (
            self._wrote,
            frame.trial,
            frame.elapsed,
            PHASES[frame.phase],
            frame.paused,
        )
        row[self._axes] = frame.axes
        row[self._command] = frame.command
        row[self._state] = frame.state
        row[self._task] = frame.task
        self._journal.write_frame(tick.due, row)
        for event in frame.events:
            self._journal.write_event(event, tick.number)
        self._wrote = time.perf_counter() - began

    def note(self, event: Event) -> None:
        """Write an event that belongs to no frame, before the first tick."""
        self._journal.write_event(event, 0)
