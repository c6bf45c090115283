"""All streams of a session in one XDF file, with corrected times."""

import json
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from labcrane.analysis import Exporter, Participant, events_of
from labcrane.recording import (
    LABELS,
    Channel,
    SessionRecord,
    Stream,
    StreamHeader,
    XdfWriter,
    hed_sidecar,
    labelled,
    name_of,
)

START = "session.start"

NAMES, JSON = "labcrane.names", "labcrane.markers"
MARKS = "labcrane.annotations"

SIDECAR = "labcrane_labels.json"

CHUNK = 4096
"""Samples per chunk: a reader that stops early loses little."""


class MergedXdf(Exporter):
    """One file per session, for EEGLAB, MNE and pyxdf.

    The session's frames are the streams ``labcrane.state``, ``labcrane.input`` and so on; streams
    of others keep their names and number formats, and are stamped with corrected time. Its events
    are three streams of markers: ``labcrane.names`` to epoch by (``trial_start``),
    ``labcrane.labels`` with block and condition (``trial_start/block=learning/side=left``), and
    ``labcrane.markers`` with all that is known of each, as JSON. What the names mean, also in HED,
    is in ``labcrane_labels.json``. Marks that people made afterwards are ``labcrane.annotations``.

    Every stream's clock offset is 0, so that nobody corrects twice. A stream whose clock could not
    be corrected keeps its own time, and says so under ``desc/labcrane``.
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
    events = events_of(session).sort_values("time", kind="stable")
    told = list(zip(events["name"].astype(str), events["data"], strict=True))
    names = [name_of(name) for name, _ in told]
    # The first event holds the whole context; it stays in the participant file.
    texts = [
        json.dumps({"event": name, **({} if name == START else data)}, ensure_ascii=False)
        for name, data in told
    ]
    for stream_name, channel, samples in (
        (NAMES, Channel("name", "none", "Name"), names),
        (LABELS, Channel("label", "none", "Label"), labelled(told)),
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
    names = list(stream.units)
    count = len(stream) if names else 0
    own = "corrected" not in stream.attrs
    kind = "Frames" if own else str(stream.attrs.get("type", ""))
    texts = any(each.dtype.kind == "O" for each in stream.columns(names, 0, 1).values())
    corrected = "yes" if own or stream.attrs["corrected"] else "no"
    # As they were sent: a participant file holds every number as a double.
    form = "double64" if own else str(stream.attrs.get("format", "double64"))
    header = StreamHeader(
        f"labcrane.{name}" if own else name,
        kind,
        tuple(Channel(column, stream.units[column]) for column in names),
        "string" if texts else form,
        rate_hz if own else float(stream.attrs.get("rate_hz", 0.0)),
        source_id=f"labcrane/{name}",
        desc={"labcrane": {"corrected": corrected}},
    )
    number = writer.add_stream(header)
    if count:
        writer.write_offset(number, float(stream.column("time", 0, 1)[0]), 0.0)
    for start in range(0, count, CHUNK):
        part = stream.columns(("time", *names), start, start + CHUNK)
        time = part.pop("time")
        if header.dtype is None:
            rows = [tuple(map(str, row)) for row in zip(*part.values(), strict=True)]
            writer.write_texts(number, time.tolist(), rows)
        else:
            rows_of_numbers = np.column_stack(list(part.values()))
            writer.write_samples(number, time, np.ascontiguousarray(rows_of_numbers, header.dtype))
