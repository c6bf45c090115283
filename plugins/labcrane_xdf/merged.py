"""All streams of a session in one XDF file, with corrected times."""

import json
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from labcrane.analysis import Exporter, Participant, presentation_failed
from labcrane.core import name_of
from labcrane.recording import (
    LABELS,
    Channel,
    SessionRecord,
    Stream,
    StreamHeader,
    XdfWriter,
    hed_sidecar,
    labelled,
)

START = "session.start"

NAMES, JSON = "labcrane.names", "labcrane.markers"
MARKS = "labcrane.annotations"

SIDECAR = "labcrane_labels.json"

CHUNK = 4096
"""Samples per chunk: a reader that stops early loses little."""


class MergedXdf(Exporter):
    """One file per session, for EEGLAB, MNE and pyxdf.

    The session's frames are the streams ``labcrane.state``, ``labcrane.input`` and so on. External
    streams keep their names and number formats, and have corrected timestamps. The session's events
    are three streams of markers: ``labcrane.names`` for epochs (``trial_start``),
    ``labcrane.labels`` with block and condition (``trial_start/block=learning/side=left``), and
    ``labcrane.markers`` with all data of each event, as JSON. ``labcrane_labels.json`` explains the
    names, also in HED. ``labcrane.annotations`` contains annotations added after the recording.

    Every stream's clock offset is 0, so that readers do not correct it twice. A regular stream with
    gaps or uneven steps states no rate, because readers fit a line through the timestamps of a
    stream that does, across the gaps. Its rate is under ``desc/labcrane/nominal_srate``. A stream
    whose clock could not be corrected keeps its own time, and the same place states this.
    """

    shared = (SIDECAR,)

    def export(self, participants: Iterable[Participant], folder: Path) -> None:
        names: set[str] = set()
        for participant in participants:
            for number, session in participant.sessions():
                path = folder / f"{participant.name}_ses-{number:02}.xdf"
                with XdfWriter(path, checked=False) as writer:
                    names |= write_session(writer, session)
        sidecar = {"label": hed_sidecar(names)}
        text = json.dumps(sidecar, indent=2, ensure_ascii=False) + "\n"
        (folder / SIDECAR).write_text(text, encoding="utf-8")


def write_session(writer: XdfWriter, session: SessionRecord) -> set[str]:
    """Write every stream of a session, and its events; return the names of the events."""
    rate_hz = float(session.attrs["rate_hz"])
    for name, stream in session.streams.items():
        _write_stream(writer, name, stream, rate_hz)
    events = session.events.sort_values("time", kind="stable")
    told = list(zip(events["name"].astype(str), events["data"], strict=True))
    names = [name_of(name) for name, _ in told]
    # The first event holds the whole context; it stays in the participant file.
    texts = [
        json.dumps({"event": name, **({} if name == START else data)}, ensure_ascii=False)
        for name, data in told
    ]
    for stream_name, channel, samples in (
        (NAMES, Channel("name", "none", "Name"), names),
        (LABELS, Channel("label", "none", "Label"), labelled(told, presentation_failed(session))),
        (JSON, Channel("event", "none", "JSON"), texts),
    ):
        number = writer.add_stream(StreamHeader(stream_name, "Markers", (channel,), "string"))
        time = events["time"].tolist()
        if time:
            writer.write_offset(number, time[0], 0.0)
        writer.write_texts(number, time, [(text,) for text in samples])
    _write_marks(writer, session)
    return set(names)


def _write_marks(writer: XdfWriter, session: SessionRecord) -> None:
    """Write what people marked afterwards, where there is any: the text, and for how long."""
    marks = session.annotations
    if marks.empty:
        return
    channels = (Channel("text", "none", "Annotation"), Channel("duration", "s", "Duration"))
    number = writer.add_stream(StreamHeader(MARKS, "Markers", channels, "string"))
    time = marks["time"].tolist()
    writer.write_offset(number, time[0], 0.0)
    lengths = (marks["until"] - marks["time"]).tolist()
    rows = [(text, f"{each:g}") for text, each in zip(marks["text"], lengths, strict=True)]
    writer.write_texts(number, time, rows)


def _write_stream(writer: XdfWriter, name: str, stream: Stream, rate_hz: float) -> None:
    """Write a stream, a stretch of it in memory at a time."""
    count = len(stream) if stream.units else 0
    sent = stream.header
    header = _own(name, stream, rate_hz) if sent is None else _sent(name, stream, sent)
    header = replace(header, rate_hz=_steady(stream, header.rate_hz))
    number = writer.add_stream(header)
    if count:
        writer.write_offset(number, float(stream.column("time", 0, 1)[0]), 0.0)
    for start in range(0, count, CHUNK):
        part = stream.columns(("time", *stream.units), start, start + CHUNK)
        time = part.pop("time")
        if header.dtype is None:
            rows = [tuple(map(str, row)) for row in zip(*part.values(), strict=True)]
            writer.write_texts(number, time.tolist(), rows)
        else:
            rows_of_numbers = np.column_stack(list(part.values()))
            writer.write_samples(number, time, np.ascontiguousarray(rows_of_numbers, header.dtype))


def _own(name: str, stream: Stream, rate_hz: float) -> StreamHeader:
    channels = tuple(Channel(column, unit) for column, unit in stream.units.items())
    texts = any(
        each.dtype.kind == "O" for each in stream.columns(list(stream.units), 0, 1).values()
    )
    about = {"labcrane": {"corrected": "yes", "nominal_srate": repr(rate_hz)}}
    form = "string" if texts else "double64"
    source = f"labcrane/{name}"
    return StreamHeader(
        f"labcrane.{name}", "Frames", channels, form, rate_hz, source_id=source, desc=about
    )


def _sent(name: str, stream: Stream, sent: StreamHeader) -> StreamHeader:
    """Return what a stream of others is, as it was sent; what its stamps needed has been done."""
    corrected = "yes" if stream.attrs["corrected"] else "no"
    done = {"labcrane": {"corrected": corrected, "nominal_srate": repr(sent.rate_hz)}}
    told = {key: value for key, value in sent.desc.items() if key != "synchronization"}
    by_label = {channel.label: channel for channel in sent.channels}
    channels = tuple(by_label[column] for column in stream.units)
    return replace(sent, name=name, channels=channels, desc={**told, **done}, text=None)


def _steady(stream: Stream, rate_hz: float) -> float:
    """Return a stream's rate, and 0 if a line through its stamps is off by more than a sample."""
    if not rate_hz or len(stream) < 3:  # noqa: PLR2004 - a line goes through two
        return rate_hz
    time = stream.column("time")
    numbers = np.arange(len(time), dtype=np.float64)
    numbers, from_middle = numbers - numbers.mean(), time - time.mean()
    line = numbers * (numbers @ from_middle) / (numbers @ numbers)
    return rate_hz if np.abs(from_middle - line).max() * rate_hz <= 1.0 else 0.0
