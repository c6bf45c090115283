"""Reads back the streams of others, with what the recorder noted about them.

Beside a stream ``EEG``, its journal holds ``EEG|probes``, ``EEG|arrivals`` and ``EEG|notes``, each
with the number of the stream it belongs to in ``desc/of``.
"""

import json
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from labcrane.recording.journal_reader import JournalState, SessionLog, state
from labcrane.recording.xdf.header import Channel, StreamHeader
from labcrane.recording.xdf.reader import XdfFile, XdfStream, read_xdf
from labcrane.recording.xdf.samples import Texts
from labcrane.types import FloatArray

PROBES = "probes"
ARRIVALS = "arrivals"
NOTES = "notes"

SIGNAL = "signal"
"""A note of a fault of a signal that was found (``bad``), or that is there no more."""

OPENED = "opened"
"""The first note of every part: counts of samples start anew with it."""

RESET = "reset"
"""A note of a source that was replaced."""

COUNTER_GAP = "counter gap"
"""A note of samples that the source's own counter left out; ``missing`` says how many."""
PROBE_CHANNELS = tuple(Channel(label, "s") for label in ("remote_time", "offset", "rtt", "local"))
ARRIVAL_CHANNELS = (Channel("count", "1"), Channel("time", "s"))


@dataclass(frozen=True, slots=True)
class Note:
    """Something the recorder noticed: a reset, a gap, a loss.

    Attributes
    ----------
    time
        On our clock, in seconds.
    data
        What it says; ``samples`` in it are indices into the stream.
    """

    time: float
    data: Mapping[str, Any]


@dataclass(frozen=True)
class RecordedStream:
    """One stream of others, all parts in order.

    Attributes
    ----------
    header
        As the source gave it, in the first part.
    time_raw
        Stamps on the source's clock, in seconds, shape ``(n,)``.
    data
        Shape ``(n, n_channels)``; empty for texts.
    texts
        One tuple per sample; empty for numbers.
    probes
        Every measured clock offset, shape ``(n_probes, 4)``: the source's time, offset (ours minus
        the source's), round trip and our time, in seconds.
    arrivals
        Shape ``(n_arrivals, 2)``: how many samples had come at which of our times.
    notes
        What the recorder noticed, in order.
    offsets
        Clock offsets as XDF has them, shape ``(n_offsets, 2)``.
    starts
        Index of the first sample of each part.
    """

    header: StreamHeader
    time_raw: FloatArray
    data: npt.NDArray[np.generic]
    texts: Texts
    probes: FloatArray
    arrivals: FloatArray
    notes: tuple[Note, ...]
    offsets: FloatArray
    starts: tuple[int, ...] = (0,)


@dataclass(frozen=True, slots=True)
class Correction:
    """Stamps on our clock, and how right they are.

    Attributes
    ----------
    time
        In seconds, shape ``(n,)``.
    quality
        Figures and texts by name, kept as attributes of the corrected time.
    """

    time: FloatArray
    quality: Mapping[str, float | str] = field(default_factory=dict)


Correct = Callable[[RecordedStream], Correction]


@dataclass(frozen=True, slots=True)
class Conclusion:
    """What is worked out of a recording when it is put into the participant file.

    Attributes
    ----------
    correct
        Maps a stream's stamps onto our clock; called once for every stream.
    report
        Called last with the session's frames and events; what it returns is kept as the session's
        sync report. None keeps no report.
    """

    correct: Correct
    report: Callable[[SessionLog], Mapping[str, Any]] | None = None


Conclude = Callable[[Mapping[str, Any]], Conclusion]
"""Called with a session's context: the study may say more of a stream than its header."""


def companion_headers(header: StreamHeader, number: int) -> dict[str, StreamHeader]:
    """Return the headers of what is noted beside the stream with this number, by what they are."""

    def beside(kind: str, form: str, channels: tuple[Channel, ...]) -> StreamHeader:
        name, desc = f"{header.name}|{kind}", {"of": str(number)}
        return StreamHeader(name, f"labcrane.{kind}", channels, form, desc=desc)

    return {
        PROBES: beside(PROBES, "double64", PROBE_CHANNELS),
        ARRIVALS: beside(ARRIVALS, "double64", ARRIVAL_CHANNELS),
        NOTES: beside(NOTES, "string", (Channel("note"),)),
    }


def read_streams(paths: Sequence[Path]) -> tuple[list[RecordedStream], list[JournalState]]:
    """Read the parts of a journal of streams; a stream goes on where its source was the same.

    Sources without a source id cannot be known again: each part has a stream of its own.
    """
    streams: dict[object, RecordedStream] = {}
    states = []
    for part, path in enumerate(paths):
        file = read_xdf(path)
        states.append(state(file))
        seen: Counter[object] = Counter()
        for stream in _streams(file):
            header = stream.header
            source = header.source_id or f"part {part}"
            key: object = (header.name, source, header.format, header.labels)
            seen[key] += 1
            key = key, seen[key]
            streams[key] = _continued(streams[key], stream) if key in streams else stream
    return list(streams.values()), states


def _streams(file: XdfFile) -> list[RecordedStream]:
    beside: dict[tuple[str, str], XdfStream] = {}
    own = []
    for stream in file.streams:
        of = stream.header.desc.get("of")
        kind = stream.header.name.rpartition("|")[2]
        if isinstance(of, str) and kind in (PROBES, ARRIVALS, NOTES):
            beside[of, kind] = stream
        else:
            own.append(stream)
    return [
        RecordedStream(
            header=stream.header,
            time_raw=stream.stamps,
            data=stream.data,
            texts=stream.texts,
            probes=_table(beside.get((str(stream.number), PROBES)), len(PROBE_CHANNELS)),
            arrivals=_table(beside.get((str(stream.number), ARRIVALS)), len(ARRIVAL_CHANNELS)),
            notes=_notes(beside.get((str(stream.number), NOTES))),
            offsets=stream.offsets,
        )
        for stream in own
    ]


def _table(stream: XdfStream | None, width: int) -> FloatArray:
    return np.empty((0, width)) if stream is None else np.asarray(stream.data, np.float64)


def _notes(stream: XdfStream | None) -> tuple[Note, ...]:
    if stream is None:
        return ()
    return tuple(
        Note(float(time), _parsed(text))
        for (text,), time in zip(stream.texts, stream.stamps, strict=True)
    )


def _parsed(text: str) -> Mapping[str, Any]:
    try:
        content = json.loads(text)
    except ValueError:
        return {"event": "unreadable", "text": text}
    return content if isinstance(content, dict) else {"event": text}


def _continued(before: RecordedStream, after: RecordedStream) -> RecordedStream:
    """Append the next part of a stream."""
    count = len(before.time_raw)
    return replace(
        before,
        time_raw=np.concatenate([before.time_raw, after.time_raw]),
        data=np.concatenate([before.data, after.data]),
        texts=before.texts + after.texts,
        probes=np.concatenate([before.probes, after.probes]),
        arrivals=np.concatenate([before.arrivals, np.add(after.arrivals, (count, 0.0))]),
        notes=before.notes + tuple(_shifted(note, count) for note in after.notes),
        offsets=np.concatenate([before.offsets, after.offsets]),
        starts=(*before.starts, count),
    )


def _shifted(note: Note, count: int) -> Note:
    """Let the samples a note names count from the stream's first one, not from its part's."""
    samples = note.data.get("samples")
    if not isinstance(samples, list):
        return note
    return Note(note.time, {**note.data, "samples": [number + count for number in samples]})
