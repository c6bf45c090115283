"""One MAT file per participant, and the function that loads them all."""

import json
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from functools import partial
from pathlib import Path
from shutil import copyfile
from typing import TYPE_CHECKING, Any

import numpy as np

from labcrane import RecordingError
from labcrane.analysis import (
    Exporter,
    Participant,
    answers_of,
    beside_trials,
    codebook_of,
    events_of,
    measures_of,
    scores_of,
)
from labcrane.recording import SessionRecord, Stream
from labcrane_matlab.mat5 import Element, cells, numbers, struct, text, texts, write_mat
from labcrane_matlab.settings import MatlabSettings

if TYPE_CHECKING:
    import pandas as pd

READER = "read_labcrane.m"
LONGEST = 63
"""Characters in the name of a field."""

LARGEST = 2**31 - 1
"""Bytes in a variable of a MAT file of version 5."""

ROWS = 1 << 16
"""Samples of one column that are in memory at a time."""


class Matlab(Exporter):
    """A struct per participant: movements, events, streams and units, as columns.

    Field names are the columns' with underscores for dots; ``units`` has the same fields. Numbers
    are double columns, texts are cells.
    """

    shared = (READER,)

    def __init__(self, settings: MatlabSettings) -> None:
        self._settings = settings
        self._trials = Fields()

    def export(self, participants: Iterable[Participant], folder: Path) -> None:
        for participant in participants:
            content = self._content(participant)
            _refuse_large(participant.name, content)
            write_mat(folder / f"{participant.name}.mat", "labcrane", content)
        copyfile(Path(__file__).with_name(READER), folder / READER)

    def _content(self, participant: Participant) -> Element:
        measures = beside_trials(measures_of(participant), participant)
        book = codebook_of(participant, measures)
        trials = book[book["table"] == "trials"]
        return struct(
            {
                "study": text(str(participant.context.get("study", ""))),
                "participant": text(participant.name),
                "status": text(str(participant.status)),
                "why": text(participant.why),
                "trials": columns(measures, self._trials),
                "questionnaires": columns(answers_of(participant)),
                "scores": columns(scores_of(participant)),
                "units": _units(
                    dict(zip(trials["column"], trials["unit"], strict=True)), self._trials
                ),
                "sessions": cells(
                    [self._session(number, record) for number, record in participant.sessions()]
                ),
            }
        )

    def _session(self, number: int, session: SessionRecord) -> Element:
        events = events_of(session).copy()
        events["data"] = [
            "{}" if name == "session.start" else json.dumps(data, ensure_ascii=False)
            for name, data in zip(events["name"], events["data"], strict=True)
        ]
        content = {
            "number": _number(number),
            "rate_hz": _number(float(session.attrs["rate_hz"])),
            "started": text(str(session.attrs.get("started", ""))),
            "events": columns(events),
            "annotations": columns(session.annotations),
        }
        if self._settings.streams:
            names = fields(list(session.streams))
            streams = zip(names, session.streams.values(), strict=True)
            content["streams"] = struct({field: _stream(stream) for field, stream in streams})
        return struct(content)


def _stream(stream: Stream) -> Element:
    """Return a stream, whose columns are read while they are written."""
    names, count = list(stream.units), len(stream)
    return struct(
        {
            "name": text(stream.name),
            "time": _read(count, lambda cut: stream.column("time", cut.start, cut.stop)),
            "data": struct(
                {
                    field: _read(count, partial(_channel, stream, name))
                    for field, name in zip(fields(names), names, strict=True)
                }
            ),
            "units": _units(stream.units),
        }
    )


def _channel(stream: Stream, name: str, cut: slice) -> Any:
    return stream.values([name], cut.start, cut.stop)[name]


def _read(count: int, read: Callable[[slice], Any]) -> Element:
    """Return a column of a stream, a piece of which ``read`` reads."""

    def pieces() -> Iterator[Any]:
        for at in range(0, count, ROWS):
            yield read(slice(at, at + ROWS))

    if read(slice(0, 1)).dtype.kind in "fiub":
        return numbers(count, pieces)
    return texts(count, lambda: (_cell(value) for piece in pieces() for value in piece))


def columns(table: "pd.DataFrame", fields: "Fields | None" = None) -> Element:
    """Return a table as a struct of columns: numbers as doubles, everything else as cells."""
    of = (fields or Fields()).of
    return struct({of(str(name)): _column(table[name]) for name in table})


def _column(values: "pd.Series[Any]") -> Element:
    if values.dtype.kind in "fiub":
        doubles = values.to_numpy(np.float64)
        return numbers(len(doubles), lambda: [doubles])
    return texts(len(values), lambda: map(_cell, values))


def _cell(value: Any) -> str:
    return "" if value is None or value != value else str(value)  # noqa: PLR0124 - NaN


def _number(value: float) -> Element:
    return numbers(1, lambda: [np.array([value])])


class Fields:
    """Names that can be fields: letters, digits and underscores, all different.

    A name keeps the field that it was given first, so that a column is the same field in the files
    of people whose columns differ.
    """

    def __init__(self) -> None:
        self._fields: dict[str, str] = {}

    def of(self, name: str) -> str:
        """Return the field of a name."""
        if name not in self._fields:
            self._fields[name] = _field(name, self._fields.values())
        return self._fields[name]


def fields(names: Iterable[str]) -> list[str]:
    """Return the field names for names in the same struct."""
    taken: list[str] = []
    for name in names:
        taken.append(_field(name, taken))
    return taken


def _field(name: str, taken: Collection[str]) -> str:
    field = "".join(c if c.isascii() and c.isalnum() else "_" for c in name)[:LONGEST]
    field = field if field[:1].isalpha() else f"x{field}"[:LONGEST]
    number, unique = 1, field
    while unique in taken:
        number += 1
        unique = f"{field[: LONGEST - 4]}_{number}"
    return unique


def _units(units: Mapping[str, str], fields: Fields | None = None) -> Element:
    of = (fields or Fields()).of
    return struct({of(name): text(unit) for name, unit in units.items()})


def _refuse_large(name: str, content: Element) -> None:
    if content.size > LARGEST:
        raise RecordingError(
            f"{name} has {content.size / 1e9:.1f} GB of numbers; a MAT file of version 5 holds 2 "
            "GB: read the participant file itself with h5read, or export with --set streams=false"
        )
