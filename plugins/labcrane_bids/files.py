"""File names, tables and descriptions as BIDS writes them."""

import gzip
import json
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import chain, count
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from labcrane import FloatArray
from labcrane.recording import SessionRecord, Stream

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

MISSING = "n/a"

EYE = re.compile(r"eye\d+", re.IGNORECASE)
"""EntityLabels that BIDS keeps for recordings of eyes."""

DEVICE = {
    "Manufacturer": "acquisition/manufacturer",
    "ManufacturersModelName": "acquisition/model",
    "DeviceSerialNumber": "acquisition/serial_number",
}
"""Facts of a device, by their place in the description of an XDF header."""

ROWS = 1 << 16
"""Samples that are in memory at a time."""


def label(text: str) -> str:
    """Return a value of an entity: letters and digits only."""
    return "".join(letter for letter in text if letter.isascii() and letter.isalnum())


class EntityLabels:
    """EntityLabels of streams or questionnaires, one for each name; no two differ in case alone.

    One object serves a whole data set, so that a name has one label in all its sessions.

    Parameters
    ----------
    called
        What a name is called as long as no other one is.
    fallback
        What a name without ASCII letters or digits is called.
    """

    def __init__(self, called: Callable[[str], str] = label, fallback: str = "stream") -> None:
        self._called, self._fallback = called, fallback
        self._given: dict[str, str] = {}

    def __call__(self, name: str) -> str:
        """Return the label of a name."""
        if name not in self._given:
            first = self._called(name) or self._fallback
            taken = {each.lower() for each in self._given.values()}
            numbered = chain([first], (f"{first}x{number}" for number in count(2)))
            self._given[name] = next(
                each for each in numbered if each.lower() not in taken and not EYE.fullmatch(each)
            )
        return self._given[name]


def first_tick(session: SessionRecord) -> float:
    """Return when a session's first tick was, in seconds on its clock."""
    return float(session.streams["state"].column("time", 0, 1)[0])


def stated_facts(stream: Stream, fields: Mapping[str, str]) -> dict[str, str]:
    """Return what a stream's header states of its device.

    Parameters
    ----------
    fields
        Place of each fact in the header's description: ``acquisition/manufacturer``.
    """
    found = {}
    for name, place in fields.items():
        here: object = stream.header.desc if stream.header is not None else {}
        for step in place.split("/"):
            here = here.get(step, "") if isinstance(here, Mapping) else ""
        if isinstance(here, str) and here.strip():
            found[name] = " ".join(here.split())
    return found


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Write a description."""
    path.write_text(json.dumps(content, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")


def write_tsv(path: Path, table: "pd.DataFrame") -> None:
    """Write a table with its header; missing values are n/a."""
    text = table.to_csv(sep="\t", index=False, na_rep=MISSING, lineterminator="\n")
    path.write_text(text, encoding="utf-8")


def write_bare_tsv(path: Path, pieces: Iterable[Sequence[FloatArray]]) -> None:
    """Write numbers without a header, as motion and physio files are; compressed for .gz.

    Parameters
    ----------
    pieces
        Columns of some rows, in chunks, so that memory stays small.
    """
    with path.open("wb") as file:
        if path.suffix != ".gz":
            _write_rows(file, pieces)
            return
        # Without a name and a time in its head, the same data are the same file.
        with gzip.GzipFile(filename="", mode="wb", fileobj=file, mtime=0) as packed:
            _write_rows(packed, pieces)


def _write_rows(file: BinaryIO | gzip.GzipFile, pieces: Iterable[Sequence[FloatArray]]) -> None:
    import pyarrow as pa
    from pyarrow import csv

    options = csv.WriteOptions(include_header=False, delimiter="\t", quoting_style="none")
    for piece in pieces:
        rows = pa.table({str(n): _words(each) for n, each in enumerate(piece)})
        csv.write_csv(rows, file, options)


def _words(values: FloatArray) -> "pa.Array":
    """Return numbers as Arrow writes them; what is missing is n/a."""
    import pyarrow as pa
    import pyarrow.compute as pc

    numbers = pa.array(values)
    missing = np.isnan(values)
    if not missing.any():
        return numbers
    return pc.if_else(pa.array(missing), MISSING, numbers.cast(pa.string()))
