"""All streams of a session in one XDF file, with corrected times."""

import json
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from labcrane.analysis import Exporter, Participant
from labcrane.recording import Channel, SessionRecord, Stream, StreamHeader, XdfWriter

CHUNK = 4096
"""Samples per chunk: a reader that stops early loses little."""


class MergedXdf(Exporter):
    """One file per session, for EEGLAB, MNE and pyxdf.

    The session's frames are the streams ``labcrane.state``, ``labcrane.input`` and so on, its
    events ``labcrane.markers``; streams of others keep their names, and are stamped with corrected
    time. No clock offsets are written, so that nobody corrects twice. A stream whose clock could
    not be corrected keeps its own time, and says so under ``desc/labcrane``.
    """

    def export(self, participants: Iterable[Participant], folder: Path) -> None:
        for participant in participants:
            for number, session in participant.sessions():
                path = folder / f"{participant.name}_ses-{number:02}.xdf"
                with XdfWriter(path) as writer:
                    write_session(writer, session)


def write_session(writer: XdfWriter, session: SessionRecord) -> None:
    """Write every stream of a session, and its events."""
    rate_hz = float(session.attrs["rate_hz"])
    for name, stream in session.streams.items():
        _write_stream(writer, name, stream, rate_hz)
    header = StreamHeader(
        "labcrane.markers", "Markers", (Channel("event", "none", "JSON"),), "string"
    )
    markers = writer.add_stream(header)
    events = session.events.sort_values("time", kind="stable")
    texts = [
        (json.dumps({"event": name, **data}, ensure_ascii=False),)
        for name, data in zip(events["name"], events["data"], strict=True)
    ]
    writer.write_texts(markers, events["time"].tolist(), texts)


def _write_stream(writer: XdfWriter, name: str, stream: Stream, rate_hz: float) -> None:
    data = stream.data
    own = "corrected" not in stream.attrs
    kind = "Frames" if own else str(stream.attrs.get("type", ""))
    texts = any(column.dtype.kind == "O" for _, column in data.items())
    corrected = "yes" if own or stream.attrs["corrected"] else "no"
    header = StreamHeader(
        f"labcrane.{name}" if own else name,
        kind,
        tuple(Channel(str(column), stream.units[str(column)]) for column in data),
        "string" if texts else "double64",
        rate_hz if own else float(stream.attrs.get("rate_hz", 0.0)),
        source_id=f"labcrane/{name}",
        desc={"labcrane": {"corrected": corrected}},
    )
    number = writer.add_stream(header)
    for start in range(0, len(data), CHUNK):
        part = data.iloc[start : start + CHUNK]
        time = stream.time[start : start + CHUNK]
        if texts:
            rows = [tuple(map(str, row)) for row in part.itertuples(index=False)]
            writer.write_texts(number, time.tolist(), rows)
        else:
            writer.write_samples(number, time, np.ascontiguousarray(part, np.float64))
