"""Streams as tables with the same time column."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

from labcrane.recording import SessionRecord, Stream

if TYPE_CHECKING:
    import pandas as pd


def is_own(stream: Stream) -> bool:
    """Say whether a stream is part of the session's frames, which share one time."""
    return "corrected" not in stream.attrs


def stream_tables(session: SessionRecord) -> Iterator[tuple[str, "pd.DataFrame"]]:
    """Yield the session's frames as one table, then each stream of others.

    Columns of frames are called after their group: ``state_joint_angle_slew``.
    """
    import pandas as pd

    parts = []
    time = None
    for name, stream in session.streams.items():
        if is_own(stream):
            parts.append(stream.data.add_prefix(f"{name}."))
            time = stream.time
    frames = pd.concat(parts, axis=1)
    frames.insert(0, "time", time)
    yield "frames", snake(frames)
    for name, stream in session.streams.items():
        if not is_own(stream):
            table = stream.data.copy()
            table.insert(0, "time_raw", stream.time_raw)
            table.insert(0, "time", stream.time)
            yield name, snake(table)


def snake(table: "pd.DataFrame") -> "pd.DataFrame":
    """Return a table whose columns are lower-case words with underscores, all different."""
    names: list[str] = []
    for column in table:
        name = snake_case(str(column))
        number, unique = 1, name
        while unique in names:
            number += 1
            unique = f"{name}_{number}"
        names.append(unique)
    return table.set_axis(names, axis=1)


def snake_case(name: str) -> str:
    """Return a name that every table reader takes as it is."""
    letters = "".join(letter if letter.isalnum() else "_" for letter in name.lower())
    letters = letters.strip("_") or "column"
    return letters if letters[0].isalpha() else f"x{letters}"
