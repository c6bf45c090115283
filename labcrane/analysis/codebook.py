"""Every column of a participant's tables, with its unit and its source."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from labcrane.analysis.cohort import Participant
from labcrane.analysis.gaze import FIXATIONS, gaze_units
from labcrane.analysis.presented import PRESENTED
from labcrane.analysis.questionnaires import ANSWERS, MEANING, SCORES, asked_in, score_column
from labcrane.analysis.tables.definitions import MEASURES
from labcrane.core.items import Item
from labcrane.files.yaml import parse_yaml
from labcrane.recording.frame_log import LOOP
from labcrane.recording.participant_file.reader import SessionRecord
from labcrane.recording.trial_columns import OWN

if TYPE_CHECKING:
    import pandas as pd

IDENTITY = {
    "participant": "pseudonym, with PILOT or SIMULATED if it applies",
    "status": "complete, half-finished, pilot or simulated",
    "session": "number of the session, from 1",
    "session_name": "the protocol's name of the session",
}
EVENTS: Mapping[str, tuple[str, str]] = {
    "participant": ("", IDENTITY["participant"]),
    "session": ("1", "number of the session"),
    "time": ("s", "when it happened, on the session's clock"),
    "tick": ("1", "tick in which it happened"),
    "part": ("1", "segment of the session; increases with each interruption"),
    "trial": ("1", "number of its trial; 0 outside trials"),
    "name": ("", "what happened"),
    "label": ("", "plain name with block and condition, for epochs"),
    "data": ("", "its data, as JSON"),
}
"""Unit and meaning of the columns of the table of events."""

MEASURED, WRITTEN = "computed from the frames by labcrane", "recorded by the session"


def codebook_of(participant: Participant, measures: "pd.DataFrame") -> "pd.DataFrame":
    """Return unit, meaning and source of every column of ``measures`` and of all streams."""
    import pandas as pd

    sessions = [session for _, session in participant.sessions()]
    tables = [
        trial_codebook(measures, sessions[0], sessions),
        event_codebook(),
        questionnaire_codebook(sessions),
        fixation_codebook(),
        *map(stream_codebook, sessions),
    ]
    return pd.concat(tables).drop_duplicates(["table", "column"], ignore_index=True)


def levels_of(participant: Participant) -> dict[str, tuple[str, ...]]:
    """Return the planned levels of columns of the trial table, in the protocol's order.

    Of groups, conditions, and questions with choices.
    """
    context = participant.context
    text = str(context.get("protocol", ""))
    protocol = parse_yaml(text, "the recorded protocol", recorded=True)
    design = (protocol.get("design") if isinstance(protocol, Mapping) else None) or {}
    found = {
        column: tuple(map(str, design[key]))
        for column, key in (("group", "groups"), ("condition", "conditions"))
        if design.get(key)
    }
    for name, about in context.get("questionnaires", {}).items():
        for item in about["items"]:
            if item.get("choices"):
                found[f"{name}.{item['name']}"] = tuple(map(str, item["choices"]))
    return found


def trial_codebook(
    measures: "pd.DataFrame", session: SessionRecord, sessions: Sequence[SessionRecord] = ()
) -> "pd.DataFrame":
    """Return one row per column of the table of measures: column, unit, description, source.

    Parameters
    ----------
    sessions
        Sessions whose questionnaires may be columns of the trial table.
    """
    import pandas as pd

    asked = _asked(sessions)

    units = session.context.get("trial_units", {})
    own = {each.name: each.definition for each in OWN}  # of a file that does not define them
    definitions = own | session.context.get("trial_definitions", {})
    computed = {**MEASURES, **PRESENTED, **gaze_units(measures.columns)}
    rows = []
    for column in map(str, measures.columns):
        if column in IDENTITY:
            row = ("", IDENTITY[column], WRITTEN)
        elif column in computed:
            row = (*computed[column], MEASURED)
        elif column in asked:
            row = ("", asked[column], WRITTEN)
        else:
            defined = str(definitions.get(column) or column.replace("_", " "))
            row = (str(units.get(column, "")), defined, WRITTEN)
        rows.append(("trials", column, *row))
    return pd.DataFrame(rows, columns=["table", "column", "unit", "description", "source"])


def event_codebook() -> "pd.DataFrame":
    """Return the same for the table of events."""
    import pandas as pd

    rows = [("events", name, *about, WRITTEN) for name, about in EVENTS.items()]
    return pd.DataFrame(rows, columns=["table", "column", "unit", "description", "source"])


def fixation_codebook() -> "pd.DataFrame":
    """Return the same for the table of fixation points of the eye tracker's checks."""
    import pandas as pd

    who = {name: ("", IDENTITY[name]) for name in ("participant", "session")}
    rows = [("fixations", name, *about, MEASURED) for name, about in (who | {**FIXATIONS}).items()]
    return pd.DataFrame(rows, columns=["table", "column", "unit", "description", "source"])


def _asked(sessions: Sequence[SessionRecord]) -> dict[str, str]:
    """Return the meaning of each column of an answer or a score in the trial table."""
    meanings: dict[str, str] = {}
    for session in sessions:
        for name, about in asked_in(session).items():
            items = {f"{name}.{item['name']}": _meaning(item) for item in about["items"]}
            scores = {
                score_column(name, score["name"], items): f"score {score['name']} of {name}, "
                f"{score['lowest']:g} to {score['highest']:g}"
                for score in about["scores"]
            }
            meanings |= items | scores
    return meanings


def _meaning(item: Mapping[str, Any]) -> str:
    """Return an item's wording and its possible answers, with what they mean."""
    return f"{item['text']} ({Item(**item).takes})"


def questionnaire_codebook(sessions: Sequence[SessionRecord]) -> "pd.DataFrame":
    """Return the same for the tables of answers and scores, and for every item and score."""
    import pandas as pd

    rows = [
        (table, column, *(MEANING.get(column) or ("", IDENTITY[column])), WRITTEN)
        for table, columns in (("questionnaires", ANSWERS), ("scores", SCORES))
        for column in columns
    ]
    for session in sessions:
        for name, about in asked_in(session).items():
            rows += [
                ("questionnaires.item", f"{name}.{item['name']}", "", _meaning(item), WRITTEN)
                for item in about["items"]
            ]
            rows += [
                (
                    "scores.score",
                    f"{name}.{score['name']}",
                    "",
                    f"{score['lowest']:g} to {score['highest']:g}",
                    WRITTEN,
                )
                for score in about["scores"]
            ]
    return pd.DataFrame(rows, columns=["table", "column", "unit", "description", "source"])


def stream_codebook(session: SessionRecord) -> "pd.DataFrame":
    """Return the same for a session's streams; the table is the stream."""
    import pandas as pd

    rows, told = [], {f"loop.{each.name}": each.definition for each in LOOP}
    for name, stream in session.streams.items():
        source = "another program's stream" if "corrected" in stream.attrs else WRITTEN
        rows.append((name, "time", "s", "time on the session's clock", source))
        if "corrected" in stream.attrs:
            rows.append((name, "time_raw", "s", "time on the stream's own clock", source))
        rows += [
            (name, column, unit, told.get(f"{name}.{column}") or column.replace(".", " "), source)
            for column, unit in stream.units.items()
        ]
    return pd.DataFrame(rows, columns=["table", "column", "unit", "description", "source"])
