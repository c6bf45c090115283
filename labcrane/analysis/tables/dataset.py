"""Dataset of a study: every tick of everybody as one Arrow table, read only where it is asked for.

``dataset["P001", 1, 3]`` are the ticks of trial 3 of session 1 of P001; a slice, ``:``, takes all.
What is selected is an Arrow stream, which pyarrow, pandas, polars and duckdb take as it is.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from labcrane.analysis.cohort import Participant, find_cohort
from labcrane.errors import RecordingError
from labcrane.recording.journal import GROUPS
from labcrane.recording.participant_file.reader import SessionRecord

if TYPE_CHECKING:
    import pyarrow as pa

ROWS = 1 << 16
"""Ticks in one batch at most."""

Chosen = str | int | slice
"""A participant's name, or a number of a session or trial; a slice of nothing for all."""


def open_dataset(folder: Path | str, include: Iterable[str] = ()) -> "Dataset":
    """Open the recordings of a data folder as one dataset.

    Parameters
    ----------
    include
        As in :func:`~labcrane.analysis.cohort.find_cohort`.

    Raises
    ------
    RecordingError
        There is no such folder, or nobody is left to be used.
    """
    return Dataset(find_cohort(Path(folder), include).included)


@dataclass(frozen=True)
class Dataset:
    """Ticks of all participants; what was selected of them, without having been read.

    Columns are ``participant``, ``session``, ``trial``, ``time``, and those of the session's frames
    with their group: ``state.tip.position.x``. A column that a session does not have is null.

    Attributes
    ----------
    participants
        Whose recordings.
    sessions, trials
        Numbers of the sessions and trials that were selected; None for all.
    columns
        Names of the columns that are read; None for all.
    """

    participants: Sequence[Participant]
    sessions: tuple[int, ...] | None = None
    trials: tuple[int, ...] | None = None
    columns: tuple[str, ...] | None = None

    def __getitem__(self, key: Chosen | tuple[Chosen, ...]) -> "Dataset":
        """Select by participant, session and trial; what is not said is all.

        Raises
        ------
        RecordingError
            No participant has that name, or none has such a session.
        """
        keys = key if isinstance(key, tuple) else (key,)
        if len(keys) > 3:  # noqa: PLR2004 - participant, session, trial
            raise RecordingError(f"{keys} selects by more than participant, session and trial")
        who, session, trial, *_ = (*keys, slice(None), slice(None))
        people = self.participants
        if not _is_all(who):
            people = [person for person in people if person.name == who]
            if not people:
                known = ", ".join(person.name for person in self.participants)
                raise RecordingError(f"the dataset has no participant {who!r}; it has {known}")
        chosen = replace(
            self,
            participants=people,
            sessions=self.sessions if _is_all(session) else (_number(session),),
            trials=self.trials if _is_all(trial) else (_number(trial),),
        )
        if chosen.sessions is not None and not any(
            number in chosen.sessions for person in people for number in person.usable
        ):
            raise RecordingError(f"no selected participant has session {chosen.sessions[0]}")
        return chosen

    def select(self, *columns: str) -> "Dataset":
        """Return the same with these columns only: ``"state.tip.position.x"``.

        Raises
        ------
        RecordingError
            No session has such a column.
        """
        known = self.schema.names
        if unknown := [name for name in columns if name not in known]:
            raise RecordingError(
                f"the dataset has no column {unknown[0]!r}; it has {', '.join(known)}"
            )
        return replace(self, columns=columns)

    @cached_property
    def schema(self) -> "pa.Schema":
        """Names and types of all columns, the union over everybody's sessions."""
        import pyarrow as pa

        names: dict[str, None] = {}
        for _, _, session in self._records():
            names |= dict.fromkeys(_columns(session))
        if self.columns is not None:
            names = {name: None for name in names if name in self.columns}
        head = [("participant", pa.string()), ("session", pa.int32()), ("trial", pa.int32())]
        return pa.schema([*head, ("time", pa.float64()), *((name, pa.float64()) for name in names)])

    def batches(self) -> "Iterator[pa.RecordBatch]":
        """Yield what was selected, one batch in memory at a time."""
        for name, number, session in self._records():
            for start, stop in self._spans(session):
                for at in range(start, stop, ROWS):
                    yield self._batch(name, number, session, at, min(at + ROWS, stop))

    def reader(self) -> "pa.RecordBatchReader":
        """Return a reader of all batches: for duckdb, ``pyarrow.dataset.Scanner`` and others."""
        import pyarrow as pa

        return pa.RecordBatchReader.from_batches(self.schema, self.batches())

    def table(self) -> "pa.Table":
        """Return what was selected as one table in memory."""
        return self.reader().read_all()

    def __arrow_c_stream__(self, requested_schema: object = None) -> object:
        return self.reader().__arrow_c_stream__(requested_schema)

    def _records(self) -> Iterator[tuple[str, int, SessionRecord]]:
        for person in self.participants:
            for number, session in person.sessions():
                if self.sessions is None or number in self.sessions:
                    yield person.name, number, session

    def _spans(self, session: SessionRecord) -> Iterator[tuple[int, int]]:
        """Yield first tick and the one behind the last of each stretch of what was selected."""
        if self.trials is None:
            yield 0, len(session.streams["loop"])
            return
        inside = np.isin(session.streams["loop"].column("trial"), self.trials)
        edges = np.flatnonzero(np.diff(np.r_[False, inside, False].astype(np.int8)))
        yield from ((int(a), int(b)) for a, b in edges.reshape(-1, 2))

    def _batch(
        self, name: str, number: int, session: SessionRecord, start: int, stop: int
    ) -> "pa.RecordBatch":
        import pyarrow as pa

        count = stop - start
        loop = session.streams["loop"]
        known = _columns(session)
        trial = loop.column("trial", start, stop).astype(np.int32)
        arrays: list[Any] = [
            pa.array([name] * count, pa.string()),
            pa.array(np.full(count, number, np.int32)),
            pa.array(trial),
            pa.array(loop.column("time", start, stop)),
        ]
        for column in self.schema.names[len(arrays) :]:
            group, _, label = column.partition(".")
            arrays.append(
                pa.array(session.streams[group].column(label, start, stop))
                if column in known
                else pa.nulls(count, pa.float64())
            )
        return pa.record_batch(arrays, schema=self.schema)


def _columns(session: SessionRecord) -> list[str]:
    return [
        f"{group}.{name}"
        for group in GROUPS
        if group in session.streams
        for name in session.streams[group].units
    ]


def _is_all(chosen: Chosen) -> bool:
    if isinstance(chosen, slice) and chosen != slice(None):
        raise RecordingError(f"{chosen} selects a range; give one name or number, or : for all")
    return isinstance(chosen, slice)


def _number(chosen: Chosen) -> int:
    if isinstance(chosen, bool) or not isinstance(chosen, int | np.integer):
        raise RecordingError(f"{chosen!r} is not the number of a session or trial; give one, or :")
    return int(chosen)
