"""Faults of signals in a participant file: when each was reported, and which trials it affects."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from labcrane.recording.foreign_streams import MONITORS, SIGNAL, RecordedStream
from labcrane.recording.journal_reader import SessionLog
from labcrane.recording.participant_file.columns import write_numbers, write_texts

if TYPE_CHECKING:
    import h5py

BEFORE_S = 5.0
"""A fault may begin so long, in seconds, before its report: the trials in between are flagged."""


@dataclass(frozen=True, slots=True)
class FaultTime:
    """How long something was wrong with a signal.

    Attributes
    ----------
    stream, channel, kind, message
        What, and where; the channel is empty for the whole stream.
    start, end
        When it was reported, and when its report ended, in seconds on the session's clock; the end
        is infinite when it lasted.
    """

    stream: str
    channel: str
    kind: str
    message: str
    start: float
    end: float


def fault_times(stream: RecordedStream) -> Iterator[FaultTime]:
    """Yield the faults that the recorder noted for a stream, as they end."""
    began: dict[tuple[str, str], tuple[float, str]] = {}

    def ended(key: tuple[str, str], end: float) -> FaultTime:
        start, message = began.pop(key)
        return FaultTime(stream.header.name, *key, message, start, end)

    for note in stream.notes:
        event = note.data.get("event")
        if event == MONITORS:  # of another recorder: what those before had told has ended
            for key in list(began):
                yield ended(key, note.time)
        elif event == SIGNAL:
            key = str(note.data["channel"]), str(note.data["kind"])
            if note.data["bad"]:
                began.setdefault(key, (note.time, str(note.data["message"])))
            elif key in began:
                yield ended(key, note.time)
    for key in list(began):
        yield ended(key, np.inf)


def write_signal_faults(
    group: "h5py.Group", log: SessionLog, streams: Sequence[RecordedStream]
) -> None:
    """Write when signals were bad, and a row for each trial that one touches."""
    if not any(note.data.get("event") == SIGNAL for one in streams for note in one.notes):
        return
    faults = sorted(
        (fault for stream in streams for fault in fault_times(stream)),
        key=lambda fault: (fault.start, fault.stream, fault.channel, fault.kind),
    )
    times = group.create_group("signal_faults")
    for column in ("stream", "channel", "kind", "message"):
        write_texts(times, column, [getattr(fault, column) for fault in faults])
    for column in ("start", "end"):
        write_numbers(times, column, np.array([getattr(each, column) for each in faults]), "s")
    touched = [
        (number, attempt, fault, seconds)
        for number, attempt, start, end in _trials(log)
        for fault in faults
        if (seconds := min(end, fault.end) - max(start, fault.start - BEFORE_S)) > 0.0
    ]
    trials = group.create_group("trial_signal_faults")
    write_numbers(trials, "trial", np.array([row[0] for row in touched], np.float64), "1")
    write_numbers(trials, "attempt", np.array([row[1] for row in touched], np.float64), "1")
    for column in ("stream", "channel", "kind"):
        write_texts(trials, column, [getattr(row[2], column) for row in touched])
    write_numbers(trials, "seconds", np.array([row[3] for row in touched], np.float64), "s")


def _trials(log: SessionLog) -> Iterator[tuple[float, float, float, float]]:
    """Yield number, attempt, start and end of every trial that began."""
    running: tuple[float, float, float] | None = None
    for event in log.events:
        if event.name == "trial.start":
            number, attempt = event.data.get("trial", np.nan), event.data.get("attempt", np.nan)
            running = float(number or 0), float(attempt or 0), event.time
        elif event.name == "trial.end" and running is not None:
            yield *running, event.time
            running = None
    if running is not None and len(log.time):
        yield *running, float(log.time[-1])
