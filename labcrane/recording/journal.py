"""The journal of a session: every frame and every event, as they happen."""

import json
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np

from labcrane.core.records import Event
from labcrane.errors import PluginError, RecordingError
from labcrane.files.append import SYNC_S
from labcrane.recording.xdf.header import Channel, StreamHeader
from labcrane.recording.xdf.writer import XdfWriter
from labcrane.types import FloatArray

FRAMES = "labcrane.frames"
EVENTS = "labcrane.events"
GROUPS = ("loop", "input", "command", "state", "task")
START = "session.start"
"""The first event of every part; its data is the whole context of the session, nested JSON."""

_LABEL = re.compile(r"[A-Za-z0-9_-]+(\.[A-Za-z0-9_-]+)*")


@dataclass(frozen=True, slots=True)
class Column:
    """One number of a frame.

    Attributes
    ----------
    group
        One of :data:`GROUPS`.
    label
        Dotted path within the group: ``"joint.angle.slew"``.
    unit
        SI symbol; ``"1"`` when dimensionless.
    """

    group: str
    label: str
    unit: str


class SessionJournal:
    """The journal of one session, or of the part of it that one process runs.

    Parameters
    ----------
    path
        Must not exist; :func:`labcrane.recording.paths.next_part` gives the name.
    columns
        What a frame holds, in order.
    rate_hz
        Frames per second.
    sync_s
        Longest time, in seconds, that data wait for the disk.
    now
        The clock of a simulation; see :class:`~labcrane.recording.xdf.writer.XdfWriter`.
    """

    def __init__(
        self,
        path: Path,
        columns: Sequence[Column],
        rate_hz: float,
        sync_s: float = SYNC_S,
        now: Callable[[], float] | None = None,
    ) -> None:
        _check(columns)
        self._writer = XdfWriter(path, sync_s, now)
        self._frames = self._writer.add_stream(frames_header(columns, rate_hz))
        self._events = self._writer.add_stream(
            StreamHeader(EVENTS, "Markers", (Channel("event"),), "string", source_id=EVENTS)
        )

    @property
    def path(self) -> Path:
        """Where the journal is."""
        return self._writer.path

    @property
    def free(self) -> int:
        """Bytes free on the disk, at most a second old."""
        return self._writer.free

    def write_frame(self, stamp: float, row: FloatArray) -> None:
        """Write one frame through to the operating system.

        Parameters
        ----------
        stamp
            When the tick was due, in seconds on the session's clock.
        row
            Shape ``(n_columns,)``.

        Raises
        ------
        RecordingError
            The frame is not in the file, everything before it is: pause, and write it again.
        """
        self._writer.write_sample(self._frames, stamp, row)

    def write_frames(self, stamps: FloatArray, rows: FloatArray) -> None:
        """Write frames in one chunk: shapes ``(n_frames,)`` and ``(n_frames, n_columns)``."""
        self._writer.write_samples(self._frames, stamps, rows)

    def write_event(self, event: Event, tick: int) -> None:
        """Write one event, stamped with the time at which it happened."""
        self._writer.write_texts(self._events, (event.time,), ((event_text(event, tick),),))

    def sync(self) -> None:
        """Bring all that was written to the disk now."""
        self._writer.sync()

    def close(self) -> None:
        """Write the footers and close the file; a second call does nothing."""
        self._writer.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *raised: object) -> None:
        self.close()


def frames_header(columns: Sequence[Column], rate_hz: float) -> StreamHeader:
    """Return the header of the stream of frames."""
    channels = tuple(
        Channel(column.label, column.unit, "Frame", {"group": column.group}) for column in columns
    )
    return StreamHeader(FRAMES, "Frames", channels, "double64", rate_hz, source_id=FRAMES)


def event_text(event: Event, tick: int) -> str:
    """Return an event as one line of JSON; what JSON cannot hold, as NaN, becomes null."""
    if taken := {"event", "tick"} & event.data.keys():
        raise PluginError(
            f"event {event.name!r} has data called {', '.join(sorted(taken))}, which a journal "
            f"uses itself; give it another name"
        )
    content = {"event": event.name, "tick": tick, **event.data}
    try:
        text = json.dumps(content, allow_nan=False, ensure_ascii=False, default=_plain)
        text.encode()
    except UnicodeEncodeError:  # half a surrogate pair: file names from other systems hold them
        return json.dumps(finite(content), default=_plain)
    except ValueError:
        return json.dumps(finite(content), ensure_ascii=False, default=_plain)
    except TypeError as error:
        raise PluginError(
            f"the data of event {event.name!r} cannot be recorded: {error}"
        ) from error
    return text


def _plain(value: object) -> object:
    """Convert a value that json does not know."""
    if isinstance(value, np.generic):
        return finite(value.item())
    if isinstance(value, np.ndarray):
        return finite(value.tolist())
    if isinstance(value, Mapping):
        return finite(dict(value))
    if isinstance(value, Path):
        return str(value)
    raise TypeError(
        f"{type(value).__name__} is not a number, text, truth value or None; convert it first"
    )


def finite(value: object) -> object:
    """Return ``value`` with None in place of every NaN and infinity."""
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {name: finite(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    return value


def _check(columns: Sequence[Column]) -> None:
    """Refuse columns that would not find their place in a participant file."""
    taken: set[str] = set()
    for column in columns:
        path = f"{column.group}.{column.label}"
        if column.group not in GROUPS:
            raise RecordingError(
                f"column {column.label!r} is in group {column.group!r}; "
                f"the groups are {', '.join(GROUPS)}"
            )
        if not _LABEL.fullmatch(column.label):
            raise RecordingError(
                f"column {column.label!r} is not a dotted path of letters, digits, _ and -"
            )
        if path in taken:
            raise RecordingError(f"column {path!r} appears twice; every column needs its own name")
        taken.add(path)
    for path in taken:
        parent = path.rpartition(".")[0]
        while parent:
            if parent in taken:
                raise RecordingError(
                    f"column {path!r} cannot be below column {parent!r}; rename one of them"
                )
            parent = parent.rpartition(".")[0]
