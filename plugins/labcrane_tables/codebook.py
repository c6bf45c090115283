"""The codebook of an export: every column of its tables, as the tables call it."""

from typing import TYPE_CHECKING

from labcrane.analysis import Participant, codebook_of, levels_of
from labcrane.core import file_name_of
from labcrane_tables.frames import Names, snake_case

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

FRAMES = ("loop", "input", "command", "state", "task")
"""Groups of columns that are one table in an export."""

OTHERS = {
    "participants": {
        "participant": ("", "pseudonym, with PILOT or SIMULATED if it applies"),
        "status": ("", "complete, half-finished, pilot or simulated"),
        "why": ("", "why it is not complete"),
        "study": ("", "short name of the study"),
        "sessions": ("1", "how many sessions were recorded"),
        "first_session": ("", "when the first of them began"),
        "labcrane": ("", "version that recorded it"),
        "protocol_sha256": ("", "hash of the protocol"),
        "machine_sha256": ("", "hash of the machine"),
    },
    "annotations": {
        "participant": ("", "pseudonym, with PILOT or SIMULATED if it applies"),
        "session": ("1", "number of the session, from 1"),
        "at": ("s", "time from the first frame of the session"),
        "time": ("s", "time on the session's clock"),
        "until": ("s", "end of what was marked, on the session's clock"),
        "text": ("", "what was written"),
        "written": ("", "when it was written"),
        "coder": ("", "who wrote it, by the coder's abbreviation"),
    },
    "films": {
        "participant": ("", "pseudonym, with PILOT or SIMULATED if it applies"),
        "session": ("1", "number of the session, from 1"),
        "recording": ("", "camera, microphone or screen, as the protocol calls it"),
        "file": ("", "name of the file next to the participant file; empty if it is missing"),
        "time": ("s", "time of its first frame on the session's clock"),
        "until": ("s", "time of its last frame on the session's clock"),
        "rate_hz": ("Hz", "frames per second"),
        "frames": ("1", "frames in the file"),
        "dropped": ("1", "frames that the device or the computer dropped"),
        "time_error": ("s", "uncertainty of the times, which 95 % of the frames do not exceed"),
    },
}
"""Unit and meaning of the columns of tables that only this export has."""


class Codebook:
    """Gathers what is known of the columns of an export.

    Parameters
    ----------
    names
        What the columns of trials are called.
    """

    def __init__(self, names: Names) -> None:
        self._names = names
        self._books: list[pd.DataFrame] = []
        self._levels: dict[str, dict[str, None]] = {}
        self._types: dict[tuple[str, str], str] = {}

    def add(self, participant: Participant, measures: "pd.DataFrame") -> None:
        """Take up a participant's columns, and the planned levels of those that are words."""
        self._books.append(codebook_of(participant, measures))
        for column, levels in levels_of(participant).items():
            self._levels.setdefault(column, {}).update(dict.fromkeys(levels))

    def has(self, table: str, columns: "pa.Schema") -> None:
        """Take up the columns of a table as they were written."""
        for column in columns:
            self._types[(table, column.name)] = _type(column.type)

    def table(self) -> "pd.DataFrame":
        """Return one row per column: table, column, unit, description, source, type, levels.

        ``levels`` are lines in the order of the protocol.
        """
        import pandas as pd

        others = [
            (table, column, *about, "recorded by the session")
            for table, columns in OTHERS.items()
            for column, about in columns.items()
            if (table, column) in self._types
        ]
        book = pd.concat(self._books)
        book = pd.concat([book, pd.DataFrame(others, columns=list(book))])
        book = book.drop_duplicates(["table", "column"])
        pairs = list(zip(book["table"], book["column"], strict=True))
        levels = ["\n".join(self._levels.get(c, ())) if t == "trials" else "" for t, c in pairs]
        book = book.assign(column=[self._called(*pair) for pair in pairs])
        book["table"] = book["table"].where(~book["table"].isin(FRAMES), "frames")
        keys = zip(book["table"], book["column"], strict=True)
        book["type"] = [self._types.get(key, "") for key in keys]
        book["levels"] = levels
        files = book["table"].map(file_name_of)  # of a stream: part of its files' names
        named = book["source"] + " '" + book["table"] + "'"
        book["source"] = book["source"].where(files == book["table"], named)
        book["table"] = files
        return book.drop_duplicates(["table", "column"], ignore_index=True)

    def _called(self, table: str, column: str) -> str:
        if table == "trials":
            return self._names.of(column)
        if table in FRAMES and column != "time":
            return snake_case(f"{table}.{column}")
        return snake_case(column)


def _type(kind: "pa.DataType") -> str:
    import pyarrow as pa

    if pa.types.is_boolean(kind):
        return "truth"
    return "number" if pa.types.is_integer(kind) or pa.types.is_floating(kind) else "text"
