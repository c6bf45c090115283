"""Streams as Arrow tables with the same time column, a stretch in memory at a time."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from labcrane.recording import SessionRecord, Stream

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

ROWS = 1 << 16
"""Rows that are in memory at once."""


@dataclass(frozen=True)
class StreamTable:
    """A table with one row per sample, which is read in batches.

    Attributes
    ----------
    name
        ``"frames"``, or the name of an external stream.
    streams
        The streams whose columns the table combines; they share one time.
    names
        Names of the table's columns.
    """

    name: str
    streams: Sequence[Stream]
    names: Sequence[str]

    def batches(self) -> "Iterator[pa.RecordBatch]":
        """Yield at least one batch of rows, possibly empty; missing values are null."""
        import pyarrow as pa

        at = 0
        for parts in zip(*(stream.batches(rows=ROWS) for stream in self.streams), strict=True):
            columns = [parts[0].column(0)]
            if not is_own(self.streams[0]):
                columns.append(pa.array(self.streams[0].time_raw[at : at + ROWS]))
            columns += [column for part in parts for column in part.columns[1:]]
            arrays = [
                pa.array(column.to_numpy(zero_copy_only=False), from_pandas=True)
                for column in columns
            ]
            yield pa.record_batch(arrays, names=list(self.names))
            at += ROWS


def is_own(stream: Stream) -> bool:
    """Say whether a stream is part of the session's frames, which share one time."""
    return "corrected" not in stream.attrs


def stream_tables(session: SessionRecord) -> Iterator[StreamTable]:
    """Yield the session's frames as one table, then each external stream.

    Names of frames' columns begin with their group: ``state_joint_angle_slew``.
    """
    own = [stream for stream in session.streams.values() if is_own(stream)]
    names = [f"{stream.name}.{name}" for stream in own for name in stream.units]
    yield StreamTable("frames", own, snake_names(["time", *names]))
    for name, stream in session.streams.items():
        if not is_own(stream):
            names = snake_names(["time", "time_raw", *stream.units])
            yield StreamTable(name, [stream], names)


class Names:
    """Names of columns in an export: lower-case words with underscores, all different.

    A column keeps its first name, whichever other columns a participant's table has. So
    ``movement.time`` of a questionnaire is ``movement_time_2`` for everyone, next to the measure.
    """

    def __init__(self) -> None:
        self._names: dict[str, str] = {}

    def of(self, column: str) -> str:
        """Return what a column is called."""
        if column not in self._names:
            self._names[column] = _unlike(self._names.values(), snake_case(column))
        return self._names[column]

    def table(self, table: "pd.DataFrame") -> "pd.DataFrame":
        """Return a table whose columns are called so."""
        return table.set_axis([self.of(str(column)) for column in table], axis=1)


def snake_names(columns: Sequence[str]) -> list[str]:
    """Return columns of one table as lower-case words with underscores, all different."""
    names: list[str] = []
    for column in columns:
        names.append(_unlike(names, snake_case(column)))
    return names


def _unlike(taken: Collection[str], name: str) -> str:
    number, unique = 1, name
    while unique in taken:
        number += 1
        unique = f"{name}_{number}"
    return unique


def snake_case(name: str) -> str:
    """Return a name that every table reader accepts unchanged."""
    letters = "".join(letter if letter.isalnum() else "_" for letter in name.lower())
    letters = letters.strip("_") or "column"
    return letters if letters[0].isalpha() else f"x{letters}"
