"""Tidy tables: one row per movement, per event, per tick."""

import gzip
import json
import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from itertools import chain
from pathlib import Path
from shutil import copy, copyfile
from typing import TYPE_CHECKING, Any

from labcrane.analysis import (
    Exporter,
    Participant,
    annotations_of,
    answers_of,
    beside_trials,
    films_of,
    fixations_of,
    measures_of,
    presentation_failed,
    responses_of,
    scores_of,
    with_unseen_areas,
)
from labcrane.core import file_name_of
from labcrane.recording import SessionRecord, labelled
from labcrane_tables.codebook import Codebook
from labcrane_tables.frames import Names, StreamTable, stream_tables
from labcrane_tables.settings import TableSettings

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

READER = "read.R"
GZIP_LEVEL = 1  # 9 takes eight times as long and saves a fifth


ALWAYS = {"questionnaires": answers_of, "scores": scores_of}
SOMETIMES = {
    "annotations": annotations_of,
    "fixations": fixations_of,
    "responses": responses_of,
    "films": films_of,
}
"""Tables of a participant by name; these are written where they have rows, and as CSV alone."""


class Tables(Exporter):
    """CSV and Parquet, a codebook of all columns, and ``read.R``, which loads everything.

    ===================  ==============================================================
    ``participants``     one row per participant
    ``trials``           one row per movement: condition, results, measures
    ``events``           one row per event
    ``annotations``      one row per mark that people made afterwards, where there is one
    ``films``            one row per file of a camera, microphone or screen, where there is one
    ``questionnaires``   one row per answer
    ``scores``           one row per score of a questionnaire
    ``fixations``        one row per point at which the eye tracker was checked, where it was
    ``responses``        one row per stimulus of a detection response task, where there was one
    ``streams/``         one file per participant, session and stream, one row per tick
    ``codebook.csv``     unit, meaning, source, type and planned levels of every column
    ===================  ==============================================================
    """

    shared = (READER, "codebook.csv")

    def __init__(self, settings: TableSettings) -> None:
        self._settings = settings

    def export(self, participants: Iterable[Participant], folder: Path) -> None:
        import pandas as pd

        (folder / "streams").mkdir()
        people, trials = [], []
        found: dict[str, list[pd.DataFrame]] = {name: [] for name in (*ALWAYS, *SOMETIMES)}
        names = Names()
        book = Codebook(names)
        events = _Growing(folder / "events")
        for participant in participants:
            people.append(_person(participant))
            measures = beside_trials(measures_of(participant), participant)
            trials.append(names.table(measures))
            book.add(participant, measures)
            for name, table_of in (ALWAYS | SOMETIMES).items():
                found[name].append(table_of(participant))
            if self._settings.films:
                _copy_films(participant, found["films"][-1], folder / "films")
            for number, session in participant.sessions():
                events.add(_events(participant, number, session))
                self._streams(participant, number, session, folder / "streams", book)
        book.has("events", events.close())
        for name in SOMETIMES:
            if any(map(len, found[name])):
                book.has(name, write_csv(joined(found[name]), folder / f"{name}.csv"))
        whole = {"trials": with_unseen_areas(joined(trials))}
        whole |= {name: joined(found[name]) for name in ALWAYS}
        for name, everything in (whole | {"participants": pd.DataFrame(people)}).items():
            book.has(name, write_csv(everything, folder / f"{name}.csv"))
            everything.to_parquet(folder / f"{name}.parquet", index=False)
        write_csv(book.table(), folder / "codebook.csv")
        copyfile(Path(__file__).with_name(READER), folder / READER)

    def _streams(
        self,
        participant: Participant,
        number: int,
        session: SessionRecord,
        folder: Path,
        book: Codebook,
    ) -> None:
        forms = self._settings.streams
        if forms == "none":
            return
        for table in stream_tables(session):
            stem = f"{participant.name}_ses-{number:02}_{file_name_of(table.name)}"
            if forms in {"both", "parquet"}:
                book.has(table.name, write_parquet(table, folder / f"{stem}.parquet"))
            if forms in {"both", "csv"}:
                book.has(table.name, _write_packed_csv(table, folder / f"{stem}.csv.gz"))


def _copy_films(participant: Participant, films: "pd.DataFrame", folder: Path) -> None:
    folder.mkdir(mode=0o700, exist_ok=True)
    for name in films["file"] if len(films) else ():
        if name:
            copy(participant.path.with_name(name), folder / f"{participant.name}_{name}")


def write_parquet(table: StreamTable, path: Path) -> "pa.Schema":
    """Write a table a row group at a time; return its columns."""
    import pyarrow as pa
    from pyarrow import parquet

    batches = table.batches()
    first = next(batches)
    with parquet.ParquetWriter(path, first.schema, use_dictionary=False) as out:
        for batch in chain([first], batches):
            # write_batch would gather a million rows, some hundred megabytes, before it writes any.
            out.write_table(pa.Table.from_batches([batch]))
    return first.schema


def _write_packed_csv(table: StreamTable, path: Path) -> "pa.Schema":
    from pyarrow import csv

    batches = table.batches()
    first = next(batches)
    with packed(path) as out, csv.CSVWriter(out, first.schema) as rows:
        rows.write_batch(first)
        for batch in batches:
            rows.write_batch(batch)
    return first.schema


@contextmanager
def packed(path: Path) -> Iterator[gzip.GzipFile]:
    """Open a gzipped file for writing, without file name and time in its header."""
    with path.open("wb") as file, gzip.GzipFile("", "wb", GZIP_LEVEL, file, mtime=0) as out:
        yield out


def joined(tables: "Sequence[pd.DataFrame]") -> "pd.DataFrame":
    """Concatenate tables with the same columns; tables without rows are ignored.

    A column with numbers for some participants and words for others, as after an amendment,
    contains words.
    """
    import pandas as pd

    filled = [table for table in tables if len(table)]
    every = pd.concat(filled or tables[:1], ignore_index=True)
    mixed = {
        str(name): column.map(_in_words)
        for name, column in every.items()
        if column.dtype == object and column.dropna().map(type).nunique() > 1
    }
    return every.assign(**mixed)


def _in_words(value: object) -> object:
    if isinstance(value, float):
        return None if math.isnan(value) else f"{value:.15g}"
    return None if value is None else str(value)


class _Growing:
    """One table as CSV and Parquet that grows participant by participant."""

    def __init__(self, stem: Path) -> None:
        self._csv = stem.with_suffix(".csv")
        self._parquet = stem.with_suffix(".parquet")
        self._writer: Any = None

    def add(self, table: "pd.DataFrame") -> None:
        import pyarrow as pa
        from pyarrow import parquet

        rows = pa.Table.from_pandas(table, preserve_index=False)
        if self._writer is None:
            self._writer = parquet.ParquetWriter(self._parquet, rows.schema)
        self._writer.write_table(rows)
        table.to_csv(self._csv, mode="a", header=not self._csv.exists(), index=False)

    def close(self) -> "pa.Schema":
        """Close the files; return their columns, none if nothing was added."""
        import pyarrow as pa

        if self._writer is None:
            return pa.schema([])
        self._writer.close()
        return self._writer.schema


def write_csv(table: "pd.DataFrame", path: Path) -> "pa.Schema":
    """Write a table as CSV, compressed when the name ends in .gz; return its columns.

    What is missing is empty.
    """
    import pyarrow as pa
    from pyarrow import csv

    rows = pa.Table.from_pandas(table, preserve_index=False)  # NaN becomes null, which is empty
    if path.suffix == ".gz":
        with packed(path) as out:
            csv.write_csv(rows, out)
    else:
        csv.write_csv(rows, path)
    return rows.schema


def _person(participant: Participant) -> dict[str, object]:
    context = participant.context
    recording = participant.recording
    return {
        "participant": participant.name,
        "status": str(participant.status),
        "why": participant.why,
        "study": context.get("study", ""),
        "sessions": len(recording.sessions),
        "first_session": context.get("started", ""),
        "labcrane": context.get("versions", {}).get("labcrane", ""),
        "protocol_sha256": context.get("protocol_sha256", ""),
        "machine_sha256": context.get("machine_sha256", ""),
    }


def _events(participant: Participant, number: int, session: SessionRecord) -> "pd.DataFrame":
    told = session.events
    events = told[["time", "tick", "part", "trial", "name", "data"]].copy()
    # The first event holds the whole context; it stays in the participant file.
    events["data"] = [
        "{}" if name == "session.start" else json.dumps(data, ensure_ascii=False)
        for name, data in zip(events["name"], events["data"], strict=True)
    ]
    said = list(zip(told["name"], told["data"], strict=True))
    events.insert(
        list(events).index("name") + 1, "label", labelled(said, presentation_failed(session))
    )
    events.insert(0, "participant", participant.name)
    events.insert(1, "session", number)
    return events
