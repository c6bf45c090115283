"""Reader of what a session's journals hold."""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from labcrane.recording.journal import EVENTS, FRAMES, GROUPS, START, Column
from labcrane.recording.xdf.reader import XdfFile, XdfStream, read_xdf
from labcrane.types import FloatArray

UNREADABLE = "journal.unreadable"
"""Name of an event whose text is not valid JSON: it was damaged where the file has no checks."""


@dataclass(frozen=True, slots=True)
class LoggedEvent:
    """One event as the journal has it.

    Attributes
    ----------
    name, time, tick
        As they were written; ``tick`` is NaN when unreadable.
    part
        Which part of the journal it is in, counted from 1.
    data
        What else it says.
    """

    name: str
    time: float
    tick: float
    part: int
    data: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class JournalState:
    """How a journal was found.

    Attributes
    ----------
    size
        Bytes.
    samples
        Samples of all streams.
    torn, damaged, unchecked
        Bytes of an incomplete last chunk, bytes left out, and bytes read without a check.
    """

    name: str
    size: int
    samples: int
    torn: int
    damaged: int
    unchecked: int

    @property
    def notes(self) -> list[str]:
        """Damage of the journal, for people."""
        notes = []
        if self.damaged:
            notes.append(f"{self.name}: {self.damaged} bytes are damaged and were left out")
        if self.unchecked:
            notes.append(
                f"{self.name}: {self.unchecked} bytes were read, but have lost their checks"
            )
        return notes


@dataclass(frozen=True)
class Frames:
    """The frames of one part of a journal; its numbers are read when they are asked for.

    Attributes
    ----------
    part
        Which part of the journal, counted from 1.
    stream
        Where they are.
    columns
        What a row holds.
    """

    part: int
    stream: XdfStream
    columns: list[Column]


@dataclass
class SessionLog:
    """Frames and events of a session, all parts in order.

    Attributes
    ----------
    columns
        What a row holds; the union over the parts.
    time
        Per frame, in seconds; shape ``(n_frames,)``.
    frames
        The parts that hold frames.
    events
        In the order of the parts.
    """

    columns: list[Column] = field(default_factory=list)
    time: FloatArray = field(default_factory=lambda: np.empty(0))
    frames: list[Frames] = field(default_factory=list)
    events: list[LoggedEvent] = field(default_factory=list)

    @property
    def context(self) -> Mapping[str, Any]:
        """The session's description in the first segment; empty when it was killed before."""
        return next((event.data for event in self.events if event.name == START), {})

    @property
    def part(self) -> FloatArray:
        """Which part each frame is in, shape ``(n_frames,)``."""
        counts = [len(frames.stream.stamps) for frames in self.frames]
        return np.repeat([float(frames.part) for frames in self.frames], counts)

    @property
    def rows(self) -> FloatArray:
        """All numbers, shape ``(n_frames, n_columns)``; NaN where a part has no such column."""
        whole = np.empty((len(self.time), len(self.columns)))
        end = 0
        for block in self.blocks():
            whole[end : end + len(block)] = block
            end += len(block)
        return whole

    def blocks(self) -> Iterator[FloatArray]:
        """Yield :attr:`rows` in blocks of a few MB, each of shape ``(n, n_columns)``."""
        for frames in self.frames:
            for block in frames.stream.blocks():
                yield _widened(block, frames.columns, self.columns)

    def column(self, group: str, label: str) -> FloatArray | None:
        """Return one column of all frames; None if there is none."""
        for number, column in enumerate(self.columns):
            if (column.group, column.label) == (group, label):
                parts = [block[:, number].copy() for block in self.blocks()]
                return np.concatenate(parts) if parts else np.empty(0)
        return None


def state(file: XdfFile) -> JournalState:
    """Return how a journal was found."""
    return JournalState(
        name=file.path.name,
        size=file.path.stat().st_size,
        samples=sum(len(stream.stamps) for stream in file.streams),
        torn=file.torn,
        damaged=sum(span.stop - span.start for span in file.damaged),
        unchecked=sum(span.stop - span.start for span in file.unchecked),
    )


def read_journal(paths: Sequence[Path]) -> tuple[SessionLog, list[JournalState]]:
    """Read the parts of a session's journal, in order."""
    files = [read_xdf(path) for path in paths]
    return merge(files), [state(file) for file in files]


def merge(files: Iterable[XdfFile]) -> SessionLog:
    """Put the parts of a session's journal together."""
    log = SessionLog()
    for part, file in enumerate(files, start=1):
        for stream in file.streams:
            if stream.header.name == EVENTS:
                log.events += _events(stream, part)
            elif stream.header.name == FRAMES:
                log.frames.append(Frames(part, stream, _columns(stream)))
    for frames in log.frames:
        log.columns += [column for column in frames.columns if column not in log.columns]
    if log.frames:
        log.time = _joined([frames.stream.stamps for frames in log.frames])
    return log


def _joined(parts: Sequence[FloatArray]) -> FloatArray:
    """Return all segments as one array; a single one without copying, which is slow."""
    return parts[0] if len(parts) == 1 else np.concatenate(parts)


def _columns(stream: XdfStream) -> list[Column]:
    return [
        Column(channel.extra.get("group", GROUPS[0]), channel.label, channel.unit)
        for channel in stream.header.channels
    ]


def _widened(
    block: npt.NDArray[np.generic], columns: list[Column], union: list[Column]
) -> FloatArray:
    data = np.asarray(block, np.float64)
    if columns == union:
        return data
    rows = np.full((len(data), len(union)), np.nan)
    rows[:, [union.index(column) for column in columns]] = data
    return rows


def _events(stream: XdfStream, part: int) -> list[LoggedEvent]:
    return [
        _event(text, float(time), part)
        for (text,), time in zip(stream.texts, stream.stamps, strict=True)
    ]


def _event(text: str, time: float, part: int) -> LoggedEvent:
    try:
        content = json.loads(text)
        name, tick = str(content.pop("event")), float(content.pop("tick"))
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        return LoggedEvent(UNREADABLE, time, np.nan, part, {"text": text})
    return LoggedEvent(name, time, tick, part, content)
