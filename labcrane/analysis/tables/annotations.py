"""Annotations table: what people marked in one participant's recordings afterwards."""

from typing import TYPE_CHECKING

from labcrane.analysis.cohort import Participant
from labcrane.recording.annotations import COLUMNS

if TYPE_CHECKING:
    import pandas as pd


def annotations_of(participant: Participant) -> "pd.DataFrame":
    """Return one row per mark: participant, session, time, until, text, written and coder.

    ``time`` and ``until`` are in seconds on the session's clock, as everywhere; ``at`` is in
    seconds from the session's first frame, as the viewer shows it.

    Raises
    ------
    RecordingError
        The marks of a session cannot be read.
    """
    import pandas as pd

    tables = []
    for number, session in participant.sessions():
        marks = session.annotations
        if len(marks):
            zero = float(session.streams["state"].column("time", 0, 1)[0])
            marks.insert(0, "participant", participant.name)
            marks.insert(1, "session", number)
            marks.insert(2, "at", marks["time"] - zero)
            tables.append(marks)
    columns = ["participant", "session", "at", *COLUMNS]
    return pd.concat(tables, ignore_index=True) if tables else pd.DataFrame(columns=columns)
