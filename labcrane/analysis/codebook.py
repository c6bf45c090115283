"""Every column of a participant's tables, with its unit and its source."""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from labcrane.analysis.cohort import Participant
from labcrane.analysis.gaze import FIXATIONS, gaze_units
from labcrane.analysis.presented import PRESENTED
from labcrane.analysis.questionnaires import ANSWERS, MEANING, SCORES, score_column
from labcrane.analysis.statistics.mixed import TIMES
from labcrane.analysis.tables.definitions import MEASURES
from labcrane.analysis.tables.responses import MEANING as RESPONSES
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


Row = tuple[str, str, str, str, str]
COLUMNS = ("table", "column", "unit", "description", "source")


def codebook_of(participant: Participant, measures: "pd.DataFrame") -> "pd.DataFrame":
    """Return unit, meaning and source of every column of ``measures`` and of all streams."""
    import pandas as pd

    sessions = [session for _, session in participant.sessions()]
    contexts = [session.context for session in sessions]
    who = {name: ("", IDENTITY[name]) for name in IDENTITY}
    fixations = {"participant": who["participant"], "session": who["session"], **FIXATIONS}
    rows = [
        *_of_trials(measures, contexts),
        *_described("events", EVENTS, WRITTEN),
        *_described("questionnaires", {name: (who | MEANING)[name] for name in ANSWERS}, WRITTEN),
        *_described("scores", {name: (who | MEANING)[name] for name in SCORES}, WRITTEN),
    ]
    for name, items, scores in _asked(contexts):
        for table, columns in (("questionnaires.item", items), ("scores.score", scores)):
            about = {f"{name}.{column}": ("", meaning) for column, meaning in columns.items()}
            rows += _described(table, about, WRITTEN)
    rows += _described("fixations", fixations, MEASURED)
    keys = {name: who[name] for name in ("participant", "status", "session")}
    rows += _described("responses", keys | RESPONSES, MEASURED)
    for session in sessions:
        rows += _of_streams(session)
    book = pd.DataFrame(rows, columns=list(COLUMNS))
    return book.drop_duplicates(["table", "column"], ignore_index=True)


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
    measures: "pd.DataFrame", contexts: Sequence[Mapping[str, Any]]
) -> "pd.DataFrame":
    """Return one row per column of the table of measures: column, unit, description, source.

    Parameters
    ----------
    contexts
        Metadata of the sessions, whose questionnaires may be columns of the trial table.
    """
    import pandas as pd

    return pd.DataFrame(_of_trials(measures, contexts), columns=list(COLUMNS))


def _of_trials(measures: "pd.DataFrame", contexts: Sequence[Mapping[str, Any]]) -> list[Row]:
    units = dict.fromkeys(TIMES, "s")  # some are computed where none was recorded
    written = {each.name: each.definition for each in OWN}  # of a file that does not define them
    for context in contexts:
        units |= context.get("trial_units", {})
        written |= context.get("trial_definitions", {})
    for name, items, scores in _asked(contexts):
        columns = {f"{name}.{item}": meaning for item, meaning in items.items()}
        columns |= {
            score_column(name, score, columns): f"score {score} of {name}, {meaning}"
            for score, meaning in scores.items()
        }
        written |= columns
    written |= IDENTITY
    computed = {**MEASURES, **PRESENTED, **gaze_units(measures.columns)}
    about = {
        name: computed.get(name)
        or (str(units.get(name, "")), str(written.get(name) or name.replace("_", " ")))
        for name in map(str, measures.columns)
    }
    return [
        ("trials", name, *each, MEASURED if name in computed else WRITTEN)
        for name, each in about.items()
    ]


def _described(table: str, about: Mapping[str, tuple[str, str]], source: str) -> Iterator[Row]:
    return ((table, column, *each, source) for column, each in about.items())


def _asked(
    contexts: Sequence[Mapping[str, Any]],
) -> Iterator[tuple[str, dict[str, str], dict[str, str]]]:
    """Yield each questionnaire by name, with the meanings of its items and of its scores."""
    for context in contexts:
        for name, about in context.get("questionnaires", {}).items():
            items = {
                item["name"]: f"{item['text']} ({Item(**item).takes})" for item in about["items"]
            }
            scores = {
                score["name"]: f"{score['lowest']:g} to {score['highest']:g}"
                for score in about["scores"]
            }
            yield name, items, scores


def _of_streams(session: SessionRecord) -> Iterator[Row]:
    """Yield the columns of a session's streams; the table is the stream."""
    told = {f"loop.{each.name}": each.definition for each in LOOP}
    for name, stream in session.streams.items():
        source = "another program's stream" if "corrected" in stream.attrs else WRITTEN
        yield name, "time", "s", "time on the session's clock", source
        if "corrected" in stream.attrs:
            yield name, "time_raw", "s", "time on the stream's own clock", source
        for column, unit in stream.units.items():
            defined = told.get(f"{name}.{column}") or column.replace(".", " ")
            yield name, column, unit, defined, source
