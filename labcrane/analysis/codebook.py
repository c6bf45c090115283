"""Every column of a participant's tables, with its unit and where it comes from."""

from typing import TYPE_CHECKING

from labcrane.analysis.cohort import Participant
from labcrane.analysis.gaze import gaze_units
from labcrane.analysis.measures import MEASURES
from labcrane.recording.participant_file.reader import SessionRecord

if TYPE_CHECKING:
    import pandas as pd

IDENTITY = {
    "participant": "pseudonym, with PILOT or SIMULATED where it is one",
    "status": "complete, half-finished, pilot or simulated",
    "session": "number of the session, from 1",
    "session_name": "the protocol's name of the session",
}
MEASURED, WRITTEN = "computed from the frames by labcrane", "recorded by the session"


def codebook_of(participant: Participant, measures: "pd.DataFrame") -> "pd.DataFrame":
    """Return unit, meaning and source of every column of ``measures`` and of all streams."""
    import pandas as pd

    sessions = [session for _, session in participant.sessions()]
    tables = [trial_codebook(measures, sessions[0]), *map(stream_codebook, sessions)]
    return pd.concat(tables).drop_duplicates(["table", "column"], ignore_index=True)


def trial_codebook(measures: "pd.DataFrame", session: SessionRecord) -> "pd.DataFrame":
    """Return one row per column of the table of measures: column, unit, description, source."""
    import pandas as pd

    units = session.context.get("trial_units", {})
    gaze = gaze_units(measures.columns)
    rows = []
    for column in map(str, measures.columns):
        if column in IDENTITY:
            row = ("", IDENTITY[column], WRITTEN)
        elif column in MEASURES:
            unit, meaning = MEASURES[column]
            row = (unit, meaning, MEASURED)
        elif column in gaze:
            row = (gaze[column], "gaze on an area of interest", MEASURED)
        else:
            row = (str(units.get(column, "")), column.replace("_", " "), WRITTEN)
        rows.append(("trials", column, *row))
    return pd.DataFrame(rows, columns=["table", "column", "unit", "description", "source"])


def stream_codebook(session: SessionRecord) -> "pd.DataFrame":
    """Return the same of a session's streams; the table is the stream."""
    import pandas as pd

    rows = []
    for name, stream in session.streams.items():
        source = "another program's stream" if "corrected" in stream.attrs else WRITTEN
        rows.append((name, "time", "s", "time on the session's clock", source))
        rows += [
            (name, column, unit, column.replace(".", " "), source)
            for column, unit in stream.units.items()
        ]
    return pd.DataFrame(rows, columns=["table", "column", "unit", "description", "source"])
