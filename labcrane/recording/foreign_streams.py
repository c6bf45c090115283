"""Streams of others, read back with what the recorder noted about them.

Beside a stream ``EEG``, its journal holds ``EEG|probes``, ``EEG|arrivals`` and ``EEG|notes``, each
with the number of the stream it belongs to in ``desc/of``.
"""

import json
import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from labcrane.recording.journal_reader import JournalState, state
from labcrane.recording.overlap import Union, sample_keys, union
from labcrane.recording.unstamped import Received, stamped
from labcrane.recording.xdf.header import Channel, StreamHeader
from labcrane.recording.xdf.reader import XdfFile, XdfStream, read_xdf
from labcrane.recording.xdf.samples import Texts
from labcrane.types import FloatArray

PROBES = "probes"
ARRIVALS = "arrivals"
NOTES = "notes"

SIGNAL = "signal"
"""A note of a fault of a signal that was found (``bad``), or that is there no more."""

MONITORS = "monitors"
"""A note of the monitors that look at the signal from now on; reports of others have ended."""

OPENED = "opened"
"""The first note of every part: its recorder began to receive the stream."""

RESET = "reset"
"""A note of a source that was replaced."""

SAME_CLOCK_S = 10.0

TAKEN = "taken"
"""Which stream was taken where any of its type would have been."""

UNSTAMPED = "unstamped"
"""A note of samples that came without a timestamp, and whose timestamps are reconstructed."""

COUNTER_GAP = "counter gap"
"""A note of samples that the source's own counter left out; ``missing`` says how many."""
PROBE_CHANNELS = tuple(Channel(label, "s") for label in ("remote_time", "offset", "rtt", "local"))
ARRIVAL_CHANNELS = (Channel("count", "1"), Channel("time", "s"))
OWN_CLOCK_CHANNELS = (
    Channel("time", "s"),
    Channel("raw", "s"),
    Channel("frequency", "ppm"),
    Channel("tick", "us"),
    Channel("offset", "s"),
)
"""The monotonic clock, one that nothing turns, and its adjustments as adjtimex reports them."""

OWN_CLOCK = StreamHeader("labcrane|own clock", "labcrane.own_clock", OWN_CLOCK_CHANNELS, "double64")
"""The one stream of a journal that is the recorder's own, not a companion of another."""


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
    """One external stream, all segments in order.

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
    own_clock
        The recorder's clock and one that is never adjusted, shape ``(n_readings, 5)``, in the order
        of :data:`OWN_CLOCK_CHANNELS`; empty where the system has none.
    starts
        Index of the first sample, and of the first one after each time without any recorder.
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
    own_clock: FloatArray = field(default_factory=lambda: np.empty((0, len(OWN_CLOCK_CHANNELS))))


def companion_headers(header: StreamHeader, number: int) -> dict[str, StreamHeader]:
    """Return the headers of the companions of the stream with this number, by kind."""

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

    Parts may overlap: two recorders write at once, so that the death of one loses nothing. What
    both have is there once (:mod:`labcrane.recording.overlap`). A source without a source id is
    known again while its program runs, by the uid that LSL gives it.
    """
    found: dict[object, list[RecordedStream]] = {}
    states = []
    for part, path in enumerate(paths):
        file = read_xdf(path)
        states.append(state(file))
        seen: Counter[object] = Counter()
        for stream in _streams(file):
            header = stream.header
            source = header.source_id or _uid(header) or f"part {part}"
            key: object = (header.name, source, header.format, header.labels)
            seen[key] += 1
            found.setdefault((key, seen[key]), []).append(stream)
    return [_of_parts(streams) for streams in found.values()], states


def _uid(header: StreamHeader) -> str:
    found = re.search(r"<uid>([^<]+)</uid>", header.text or "")
    return found[1] if found else ""


def _of_parts(streams: list[RecordedStream]) -> RecordedStream:
    """Return one stream of what each part has of it, in the order in which they were opened."""
    streams = _all_stamped(streams)
    opened = [_opened(stream) for stream in streams]
    if None not in opened:
        streams = [streams[at] for at in np.argsort(np.array(opened, float), kind="stable")]
    return reduce(_continued, streams)


def _all_stamped(streams: Sequence[RecordedStream]) -> list[RecordedStream]:
    """Return each segment of a stream, with timestamps for samples that came without one."""
    received = [Received(each.time_raw, each.data, each.texts) for each in streams]
    found = []
    for at, stream in enumerate(streams):
        others = [*received[:at], *received[at + 1 :]]
        stamps, estimated = stamped(received[at], stream.header.rate_hz, others)
        notes = [
            Note(float(stamps[end]), {"event": UNSTAMPED, "samples": [begin, end]})
            for begin, end in estimated
        ]
        found.append(replace(stream, time_raw=stamps, notes=(*stream.notes, *notes)))
    return found


def _opened(stream: RecordedStream) -> float | None:
    """Return when its recorder began to receive a stream; None of files of other recorders."""
    return next((note.time for note in stream.notes if note.data.get("event") == OPENED), None)


def _last_heard(stream: RecordedStream) -> float:
    """Return when a recorder is last known to have lived."""
    times = [stream.arrivals[:, 1], stream.probes[:, 3]]
    return max((float(each.max()) for each in times if len(each)), default=-math.inf)


def _streams(file: XdfFile) -> list[RecordedStream]:
    beside: dict[tuple[str, str], XdfStream] = {}
    own = []
    clock = np.empty((0, len(OWN_CLOCK_CHANNELS)))
    for stream in file.streams:
        if stream.header.type == OWN_CLOCK.type:
            clock = _table(stream, len(OWN_CLOCK_CHANNELS))
            continue
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
            own_clock=clock,
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
    """Return a stream with what another part has of it, each sample once.

    LSL sends a new receiver nothing of what was before: a part that was opened after the last sign
    of life of those before has none of their samples.
    """
    opened, ended = _opened(after), _last_heard(before)
    if overlap := opened is not None and opened <= ended:
        found = union(_keys(before), _keys(after))
        if len(before.arrivals) and len(after.arrivals):
            found = found.as_they_came(_came(before), _came(after))
    else:
        count = len(before.time_raw)
        here = np.arange(len(after.time_raw)) + count
        found = Union(np.arange(count), here, count + len(here))
    texts: Texts = []
    if before.texts or after.texts:
        texts = [()] * found.size
        for stream, places in ((after, found.second), (before, found.first)):
            for place, row in zip(places.tolist(), stream.texts, strict=True):
                texts[place] = row
    late = after.probes[:, 3] > ended if overlap else slice(None)
    ours, theirs = list(before.notes), list(after.notes)
    if overlap and opened is not None:
        ours, theirs = _told_once(ours, theirs, opened, ended)
    notes = [_moved(note, found.first) for note in ours]
    notes += [_moved(note, found.second) for note in theirs]
    goes_on = () if overlap else (len(before.time_raw),)
    return replace(
        before,
        time_raw=_merged(found, before.time_raw, after.time_raw),
        data=_merged(found, before.data, after.data),
        texts=texts,
        probes=np.concatenate([before.probes, after.probes[late]]),
        arrivals=_arrivals(found, before.arrivals, after.arrivals, overlap=overlap),
        notes=tuple(sorted(notes, key=lambda note: note.time) if overlap else notes),
        offsets=np.concatenate([before.offsets, _later(after.offsets, after.probes, late)]),
        starts=(*before.starts, *goes_on),
        own_clock=both_clocks(before.own_clock, after.own_clock),
    )


def _came(stream: RecordedStream) -> FloatArray:
    """Return when each sample came, in seconds; infinite where that is not known."""
    which = np.searchsorted(stream.arrivals[:, 0], np.arange(len(stream.time_raw)), side="right")
    return np.asarray(np.r_[stream.arrivals[:, 1], np.inf][which])


def _told_once(
    ours: Sequence[Note], theirs: Sequence[Note], opened: float, ended: float
) -> tuple[list[Note], list[Note]]:
    """Return which notes of two recorders count, where both have recorded the same.

    What the first says counts, but for its signals: monitors are processes of their own, and the
    first's may have begun late or died. The one whose monitors reported more is used.
    """

    def both(note: Note) -> bool:
        return opened <= note.time <= ended

    def signals(notes: Sequence[Note]) -> list[Note]:
        return [note for note in notes if note.data.get("event") == SIGNAL and both(note)]

    kept, other = list(ours), signals(theirs)
    if len(other) > len(signals(ours)):
        kept = [note for note in ours if not (note.data.get("event") == SIGNAL and both(note))]
    else:
        other = []
    own = {OPENED, UNSTAMPED}  # of a recorder, not of the stream
    later = [note for note in theirs if note.time > ended or note.data.get("event") in own]
    return kept, [*other, *later]


def both_clocks(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return the readings of one computer's clock by two recorders, in order, each once.

    Monotonic clocks restart with the computer: of two logs that do not agree, the longer is used.
    """
    if not len(one) or not len(other):
        return one if len(one) else other
    apart = (one[-1, 1] - one[-1, 0]) - (other[0, 1] - other[0, 0])
    if abs(apart) > SAME_CLOCK_S:
        return max(one, other, key=len)
    together = np.concatenate([one, other])
    _, first = np.unique(together[:, 0], return_index=True)
    return np.asarray(together[first])


def _keys(stream: RecordedStream) -> "npt.NDArray[np.uint64]":
    return sample_keys(stream.time_raw, stream.data, stream.texts)


def _merged(found: Union, before: npt.NDArray[Any], after: npt.NDArray[Any]) -> npt.NDArray[Any]:
    whole = np.empty((found.size, *before.shape[1:]), before.dtype)
    if len(after) or len(before):
        whole[found.second[: len(after)]] = after
        whole[found.first[: len(before)]] = before
    return whole


def _arrivals(found: Union, before: FloatArray, after: FloatArray, *, overlap: bool) -> FloatArray:
    """Return how many samples had come when: the second's report once the first is silent."""
    first, second = _counted(before, found.first), _counted(after, found.second)
    if overlap and len(first):
        ahead = (second[:, 0] > first[-1, 0]) & (second[:, 1] > first[-1, 1])
        second = second[ahead]
    return np.concatenate([first, second])


def _counted(arrivals: FloatArray, places: npt.NDArray[np.int64]) -> FloatArray:
    """Let counts be of the whole stream: a count of n is the place of sample n - 1, plus one."""
    counts = np.clip(arrivals[:, 0].astype(int), 0, len(places))
    of_whole = np.r_[places[0] if len(places) else 0, places + 1]
    return np.column_stack([of_whole[counts], arrivals[:, 1]]).astype(np.float64)


def _later(
    offsets: FloatArray, probes: FloatArray, late: "npt.NDArray[np.bool_] | slice"
) -> FloatArray:
    """Return the XDF offsets of the probes that are kept; each probe has one, in order."""
    if isinstance(late, slice) or not len(offsets):
        return offsets
    kept = np.isin(offsets[:, 0], probes[late][:, 0])
    return offsets[kept]


def _moved(note: Note, places: npt.NDArray[np.int64]) -> Note:
    """Let the samples a note names count from the stream's first one, not from its part's."""

    def place(number: int) -> int:
        if number < len(places):
            return int(places[number])
        return int(places[-1]) + 1 + number - len(places) if len(places) else number

    data = dict(note.data)
    if isinstance(numbers := data.get("samples"), list):
        data["samples"] = [place(number) for number in numbers]
    if isinstance(number := data.get("sample"), int):
        data["sample"] = place(number)
    return Note(note.time, data)
