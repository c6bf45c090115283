"""Tidy tables: one row per movement, per event, per tick."""

import gzip
import json
import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from itertools import chain
from pathlib import Path
from shutil import copyfile
from typing import TYPE_CHECKING, Any

from labcrane.analysis import (
    Exporter,
    Participant,
    annotations_of,
    answers_of,
    beside_trials,
    codebook_of,
    events_of,
    fixations_of,
    measures_of,
    presentation_failed,
    scores_of,
    with_unseen_areas,
)
from labcrane.recording import SessionRecord, labelled
from labcrane_tables.frames import Names, StreamTable, snake_case, stream_tables
from labcrane_tables.settings import TableSettings

if TYPE_CHECKING:
    import pandas as pd

READER = "read.R"
GZIP_LEVEL = 1  # 9 takes eight times as long and saves a fifth


class Tables(Exporter):
    """CSV and Parquet, a codebook of all columns, and ``read.R``, which loads everything.

    ===================  ==============================================================
    ``participants``     one row per participant
    ``trials``           one row per movement: condition, results, measures
    ``events``           one row per event
    ``annotations``      one row per mark that people made afterwards, where there is one
    ``questionnaires``   one row per answer
    ``scores``           one row per score of a questionnaire
    ``fixations``        one row per point at which the eye tracker was checked, where it was
    ``streams/``         one file per participant, session and stream, one row per tick
    ``codebook.csv``     unit, meaning and source of every column
    ===================  ==============================================================
    """

    shared = (READER, "codebook.csv")

    def __init__(self, settings: TableSettings) -> None:
        self._settings = settings

    def export(self, participants: Iterable[Participant], folder: Path) -> None:
        import pandas as pd

        (folder / "streams").mkdir()
        people, trials, codebooks, answers, scores = [], [], [], [], []
        marks, looked_at = [], []
        names = Names()
        events = _Growing(folder / "events")
        for participant in participants:
            people.append(_person(participant))
            measures = beside_trials(measures_of(participant), participant)
            trials.append(names.table(measures))
            codebooks.append(codebook_of(participant, measures))
            answers.append(answers_of(participant))
            marks.append(annotations_of(participant))
            looked_at.append(fixations_of(participant))
            scores.append(scores_of(participant))
            for number, session in participant.sessions():
                events.add(_events(participant, number, session))
                self._streams(participant, number, session, folder / "streams")
        events.close()
        for name, tables in (("annotations", marks), ("fixations", looked_at)):
            if any(map(len, tables)):
                write_csv(joined(tables), folder / f"{name}.csv")
        seen = with_unseen_areas(joined(trials))
        for name, tables in (("trials", [seen]), ("questionnaires", answers), ("scores", scores)):
            everything = joined(tables)
            write_csv(everything, folder / f"{name}.csv")
            everything.to_parquet(folder / f"{name}.parquet", index=False)
        write_csv(pd.DataFrame(people), folder / "participants.csv")
        write_csv(_codebook(codebooks, names), folder / "codebook.csv")
        copyfile(Path(__file__).with_name(READER), folder / READER)

    def _streams(
        self, participant: Participant, number: int, session: SessionRecord, folder: Path
    ) -> None:
        forms = self._settings.streams
        if forms == "none":
            return
        for table in stream_tables(session):
            stem = f"{participant.name}_ses-{number:02}_{table.name.replace('/', '-')}"
            if forms in {"both", "parquet"}:
                write_parquet(table, folder / f"{stem}.parquet")
            if forms in {"both", "csv"}:
                _write_packed_csv(table, folder / f"{stem}.csv.gz")


def write_parquet(table: StreamTable, path: Path) -> None:
    """Write a table a row group at a time."""
    import pyarrow as pa
    from pyarrow import parquet

    batches = table.batches()
    first = next(batches)
    with parquet.ParquetWriter(path, first.schema, use_dictionary=False) as out:
        for batch in chain([first], batches):
            # write_batch would gather a million rows, some hundred megabytes, before it writes any.
            out.write_table(pa.Table.from_batches([batch]))


def _write_packed_csv(table: StreamTable, path: Path) -> None:
    from pyarrow import csv

    batches = table.batches()
    first = next(batches)
    with packed(path) as out, csv.CSVWriter(out, first.schema) as rows:
        rows.write_batch(first)
        for batch in batches:
            rows.write_batch(batch)


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

    def close(self) -> None:
        if self._writer is not None:
            self._writer.close()


def write_csv(table: "pd.DataFrame", path: Path) -> None:
    """Write a table as CSV, compressed when the name ends in .gz; what is missing is empty."""
    import pyarrow as pa
    from pyarrow import csv

    rows = pa.Table.from_pandas(table, preserve_index=False)  # NaN becomes null, which is empty
    if path.suffix == ".gz":
        with packed(path) as out:
            csv.write_csv(rows, out)
    else:
        csv.write_csv(rows, path)


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
    told = events_of(session)
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


def _codebook(codebooks: "list[pd.DataFrame]", names: Names) -> "pd.DataFrame":
    """Join the participants' codebooks; columns are called as the tables call them."""
    import pandas as pd

    book = pd.concat(codebooks).drop_duplicates(["table", "column"])
    groups = ("loop", "input", "command", "state", "task")
    called = []
    for table, column in zip(book["table"], book["column"], strict=True):
        if table == "trials":
            called.append(names.of(column))
        elif table in groups and column != "time":
            called.append(snake_case(f"{table}.{column}"))
        else:
            called.append(snake_case(column))
    book = book.assign(column=called)
    book["table"] = book["table"].where(~book["table"].isin(groups), "frames")
    return book.drop_duplicates(["table", "column"], ignore_index=True)
