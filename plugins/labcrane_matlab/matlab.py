"""One MAT file per participant, and the function that loads them all."""

import json
from collections.abc import Iterable
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
    measures_of,
    scores_of,
)
from labcrane.recording import SessionRecord
from labcrane_matlab.settings import MatlabSettings

if TYPE_CHECKING:
    import pandas as pd

READER = "read_labcrane.m"
LONGEST = 63
"""Characters in the name of a field."""

LARGEST = 2**31 - 1
"""Bytes in a variable of a MAT file of version 5."""


class Matlab(Exporter):
    """A struct per participant: movements, events, streams and units, as columns.

    Field names are the columns' with underscores for dots; ``units`` has the same fields. Numbers
    are double columns, texts are cells.
    """

    shared = (READER,)

    def __init__(self, settings: MatlabSettings) -> None:
        self._settings = settings

    def export(self, participants: Iterable[Participant], folder: Path) -> None:
        from scipy.io import savemat

        for participant in participants:
            measures = beside_trials(measures_of(participant), participant)
            book = codebook_of(participant, measures)
            trials = book[book["table"] == "trials"]
            content = {
                "participant": participant.name,
                "status": str(participant.status),
                "why": participant.why,
                "trials": columns(measures),
                "questionnaires": columns(answers_of(participant)),
                "scores": columns(scores_of(participant)),
                "units": _units(dict(zip(trials["column"], trials["unit"], strict=True))),
                "sessions": np.array(
                    [self._session(number, record) for number, record in participant.sessions()],
                    object,
                ),
            }
            _refuse_large(participant.name, content["sessions"])
            savemat(
                folder / f"{participant.name}.mat",
                {"labcrane": content},
                long_field_names=True,
                do_compression=True,
                oned_as="column",
            )
        copyfile(Path(__file__).with_name(READER), folder / READER)

    def _session(self, number: int, session: SessionRecord) -> dict[str, Any]:
        events = session.events.copy()
        events["data"] = [
            "{}" if name == "session.start" else json.dumps(data, ensure_ascii=False)
            for name, data in zip(events["name"], events["data"], strict=True)
        ]
        content: dict[str, Any] = {
            "number": float(number),
            "rate_hz": float(session.attrs["rate_hz"]),
            "started": str(session.attrs.get("started", "")),
            "events": columns(events),
            "annotations": columns(session.annotations),
        }
        if self._settings.streams:
            names = fields(list(session.streams))
            content["streams"] = {
                field: {
                    "name": name,
                    "time": stream.time,
                    "data": columns(stream.data),
                    "units": _units(stream.units),
                }
                for field, (name, stream) in zip(names, session.streams.items(), strict=True)
            }
        return content


def columns(table: "pd.DataFrame") -> dict[str, Any]:
    """Return a table as a struct of columns: numbers as doubles, everything else as cells."""
    named = zip(fields([str(name) for name in table]), table, strict=True)
    return {field: _column(table[name]) for field, name in named}


def _column(values: "pd.Series[Any]") -> Any:
    if values.dtype.kind in "fiub":
        return values.to_numpy(np.float64)
    cells = np.empty(len(values), object)
    cells[:] = ["" if value is None or value != value else str(value) for value in values]  # noqa: PLR0124 - NaN
    return cells


def fields(names: list[str]) -> list[str]:
    """Return names that can be fields: letters, digits and underscores, all different."""
    taken: list[str] = []
    for name in names:
        field = "".join(c if c.isascii() and c.isalnum() else "_" for c in name)[:LONGEST]
        field = field if field[:1].isalpha() else f"x{field}"[:LONGEST]
        number, unique = 1, field
        while unique in taken:
            number += 1
            unique = f"{field[: LONGEST - 4]}_{number}"
        taken.append(unique)
    return taken


def _units(units: dict[str, str]) -> dict[str, str]:
    return dict(zip(fields(list(units)), units.values(), strict=True))


def _refuse_large(name: str, sessions: Any) -> None:
    size = _bytes(sessions.tolist())
    if size > LARGEST:
        raise RecordingError(
            f"{name} has {size / 1e9:.1f} GB of numbers; a MAT file of version 5 holds 2 GB: read "
            "the participant file itself with h5read, or export with --set streams=false"
        )


def _bytes(value: Any) -> int:
    if isinstance(value, dict):
        return sum(map(_bytes, value.values()))
    if isinstance(value, list):
        return sum(map(_bytes, value))
    return int(value.nbytes) if isinstance(value, np.ndarray) else 0
