"""One MAT file per participant, and the function that loads them all."""

import json
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from shutil import copyfile
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.io import savemat
from scipy.io.matlab import MatWriteError

from labcrane import RecordingError
from labcrane.analysis import (
    Exporter,
    Participant,
    answers_of,
    beside_trials,
    codebook_of,
    measures_of,
    responses_of,
    scores_of,
)
from labcrane.recording import SessionRecord, Stream
from labcrane_matlab.settings import MatlabSettings

if TYPE_CHECKING:
    import pandas as pd

READER = "read_labcrane.m"
LONGEST = 63
"""Characters in the name of a field."""

LARGEST = 2**31 - 1
"""Bytes in a variable of a MAT file of version 5."""

Value = Any
"""What scipy writes: a text, a column, a mapping of them, or :class:`Later`."""


class Later:
    """A column that is read when scipy writes it: one of a stream is in memory at a time."""

    def __init__(self, read: Callable[[], Value]) -> None:
        self._read = read

    def __array__(self, dtype: object = None, copy: object = None) -> Any:
        """Read the column; scipy asks for no type."""
        return _column(self._read())


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
            write_mat(folder / f"{participant.name}.mat", self._content(participant))
        copyfile(Path(__file__).with_name(READER), folder / READER)

    def _content(self, participant: Participant) -> Value:
        measures = beside_trials(measures_of(participant), participant)
        book = codebook_of(participant, measures)
        trials = book[book["table"] == "trials"]
        return {
            "study": str(participant.context.get("study", "")),
            "participant": participant.name,
            "status": str(participant.status),
            "why": participant.why,
            "trials": columns(measures, self._trials),
            "questionnaires": columns(answers_of(participant)),
            "scores": columns(scores_of(participant)),
            "responses": columns(responses_of(participant)),
            "units": _units(dict(zip(trials["column"], trials["unit"], strict=True)), self._trials),
            "sessions": _cells(
                [self._session(number, record) for number, record in participant.sessions()]
            ),
        }

    def _session(self, number: int, session: SessionRecord) -> Value:
        events = session.events.copy()
        events["data"] = [
            "{}" if name == "session.start" else json.dumps(data, ensure_ascii=False)
            for name, data in zip(events["name"], events["data"], strict=True)
        ]
        content = {
            "number": float(number),
            "rate_hz": float(session.attrs["rate_hz"]),
            "started": str(session.attrs.get("started", "")),
            "events": columns(events),
            "annotations": columns(session.annotations),
        }
        if self._settings.streams:
            names = fields(list(session.streams))
            streams = zip(names, session.streams.values(), strict=True)
            content["streams"] = {field: _stream(stream) for field, stream in streams}
        return content


def write_mat(path: Path, content: Value) -> None:
    """Write a file of the one variable ``labcrane``.

    Raises
    ------
    RecordingError
        MATLAB does not read as much; the file is removed.
    """
    with suppress(MatWriteError):  # above 4 GB scipy itself stops
        savemat(path, {"labcrane": content}, long_field_names=True, oned_as="column")
    if (size := path.stat().st_size) > LARGEST:
        path.unlink()
        raise RecordingError(
            f"{path.stem} has {size / 1e9:.1f} GB of numbers; a MAT file of version 5 holds 2 "
            "GB: read the participant file itself with h5read, or export with --set streams=false"
        )


def _stream(stream: Stream) -> Value:
    names = list(stream.units)
    return {
        "name": stream.name,
        "time": Later(partial(stream.column, "time")),
        "data": {
            field: Later(partial(_channel, stream, name))
            for field, name in zip(fields(names), names, strict=True)
        },
        "units": _units(stream.units),
    }


def _channel(stream: Stream, name: str) -> Value:
    return stream.values([name])[name]


def columns(table: "pd.DataFrame", fields: "Fields | None" = None) -> Value:
    """Return a table as a struct of columns: numbers as doubles, everything else as cells."""
    of = (fields or Fields()).of
    return {of(str(name)): _column(table[name]) for name in table}


def _column(values: Any) -> Value:
    if values.dtype.kind in "fiub":
        return np.asarray(values, np.float64)
    return _cells([_cell(value) for value in values])


def _cells(values: Sequence[Value]) -> Value:
    cells = np.empty(len(values), object)
    cells[:] = values
    return cells


def _cell(value: Any) -> str:
    return "" if value is None or value != value else str(value)  # noqa: PLR0124 - NaN


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


def _units(units: Mapping[str, str], fields: Fields | None = None) -> Value:
    of = (fields or Fields()).of
    return {of(name): unit for name, unit in units.items()}
