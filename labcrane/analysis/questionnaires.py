"""Questionnaires as tidy tables: one row per answer, and one per score."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from labcrane.analysis.cohort import Participant
from labcrane.recording.participant_file.questionnaires import ANSWER, END, SCORE
from labcrane.recording.participant_file.reader import SessionRecord

if TYPE_CHECKING:
    import pandas as pd

START = "questionnaire.start"
DECLINED, OMITTED, LEFT = "declined", "not answered", "questionnaire not handed in"
"""Reasons for a missing answer or score."""

WHEN = ("participant", "status", "session", "step", "block", "trial", "questionnaire")
ANSWERS = (*WHEN, "version", "language", "item", "value", "text", "missing", "time")
SCORES = (*WHEN, "version", "score", "value", "missing", "time")

MEANING = {
    "step": ("", "number of the step in the session, from 1"),
    "block": ("", "number of the block under way or before it; 0 before the first"),
    "trial": ("", "number of the trial it follows; empty where it follows none"),
    "questionnaire": ("", "the study's name for the questionnaire"),
    "version": ("", "what was asked: offer, plugin and version"),
    "language": ("", "language of the questions"),
    "item": ("", "name of the question"),
    "value": ("", "the answer as a number, or the score; empty where it is none"),
    "text": ("", "the answer in words, or the choice; empty where it is a number"),
    "missing": ("", f"reason for a missing answer: {DECLINED}, {OMITTED}, {LEFT}"),
    "score": ("", "name of the score"),
    "time": ("s", "when it was given or computed, on the session's clock"),
}


@dataclass
class Occasion:
    """One presentation of a questionnaire.

    Attributes
    ----------
    step, block, trial
        Its place in the session; ``trial`` is NaN if it follows none.
    answers
        The final answers, by item, with their times.
    scores
        The scores of the answers.
    handed_in
        Whether it was submitted.
    ended
        When it ended; NaN if the program stopped before.
    """

    questionnaire: str
    step: float
    trial: float
    block: float
    answers: dict[str, tuple[Any, float]] = field(default_factory=dict)
    scores: dict[str, Any] = field(default_factory=dict)
    handed_in: bool = False
    ended: float = np.nan

    @property
    def silent(self) -> str:
        """Reason for an answer or score that is missing."""
        return OMITTED if self.handed_in else LEFT


def occasions(session: SessionRecord) -> list[Occasion]:
    """Return each presentation of a questionnaire in a session, in order."""
    found: dict[tuple[object, ...], Occasion] = {}
    block = 0
    events = session.events.sort_values("time", kind="stable")
    for name, time, data in zip(events["name"], events["time"], events["data"], strict=True):
        if name == "block.start":
            block = int(data.get("block", block))
        if name not in {START, ANSWER, END}:
            continue
        trial = float(data.get("trial", np.nan))
        key = (data["questionnaire"], data["step"], str(trial))
        asked = found.setdefault(
            key, Occasion(data["questionnaire"], float(data["step"]), trial, float(block))
        )
        if name == ANSWER:
            asked.answers[data["item"]] = (data["value"], float(time))
        elif name == END:
            asked.ended, asked.handed_in = float(time), bool(data.get("handed_in"))
            asked.scores = {
                key.removeprefix(SCORE): value
                for key, value in data.items()
                if key.startswith(SCORE)
            }
    return list(found.values())


def asked_in(session: SessionRecord) -> Mapping[str, Mapping[str, Any]]:
    """Return title, language, items and scores of each questionnaire of a session's study.

    From the recording; older recordings do not have them.
    """
    about: Mapping[str, Mapping[str, Any]] = session.context.get("questionnaires", {})
    return about


def version_of(session: SessionRecord, questionnaire: str) -> str:
    """Return offer, plugin and version of a questionnaire, as recorded."""
    context = session.context
    part = context.get("components", {}).get(f"questionnaires.{questionnaire}", {})
    versions = context.get("versions", {})
    plugin = str(part.get("plugin", ""))
    version = versions.get(plugin) or versions.get("labcrane", "")
    return " ".join(filter(None, (part.get("use", questionnaire), plugin, version)))


def answers_of(participant: Participant) -> "pd.DataFrame":
    """Return one row per answer, and per item without one, of all sessions.

    ``value`` contains numbers and ``text`` words and choices; if both are empty, ``missing`` gives
    the reason. Of a changed answer, the last one applies.
    """
    import pandas as pd

    rows = participant.rows(_answers)
    return pd.DataFrame(rows, columns=list(ANSWERS)).assign(status=str(participant.status))


def scores_of(participant: Participant) -> "pd.DataFrame":
    """Return one row per score of all sessions."""
    import pandas as pd

    rows = participant.rows(_scores)
    return pd.DataFrame(rows, columns=list(SCORES)).assign(status=str(participant.status))


def beside_trials(measures: "pd.DataFrame", participant: Participant) -> "pd.DataFrame":
    """Return the table of trials with the answers after each, and their scores.

    A column is called ``QUESTIONNAIRE.ITEM``; one of a score of the same name as an item,
    ``QUESTIONNAIRE.score.NAME``. An answer to a questionnaire that follows no trial is in no row.
    Of a trial that was repeated, the last attempt has it; of one asked twice, the last answer.
    """
    if measures.empty:  # ended before its first trial
        return measures.copy()
    answers, scores = answers_of(participant), scores_of(participant)
    given: dict[tuple[int, int], dict[str, Any]] = {}
    for row in answers[answers["trial"].notna()].to_dict("records"):
        name = f"{row['questionnaire']}.{row['item']}"
        value = row["text"] or row["value"]
        given.setdefault((int(row["session"]), int(row["trial"])), {})[name] = value
    asked = {f"{row['questionnaire']}.{row['item']}" for row in answers.to_dict("records")}
    for row in scores[scores["trial"].notna()].to_dict("records"):
        name = score_column(row["questionnaire"], row["score"], asked)
        given.setdefault((int(row["session"]), int(row["trial"])), {})[name] = row["value"]
    columns = list(dict.fromkeys(name for row in given.values() for name in row))
    last = ~measures.duplicated(["session", "trial"], keep="last")
    rows = [
        given.get((int(session), int(trial)), {}) if newest else {}
        for session, trial, newest in zip(measures["session"], measures["trial"], last, strict=True)
    ]
    beside = measures.copy()
    for name in columns:
        beside[name] = [row.get(name) for row in rows]
    return beside


def score_column(questionnaire: str, score: str, asked: Collection[str]) -> str:
    """Return the name of a score's column in the trial table, next to those of items."""
    name = f"{questionnaire}.{score}"
    return f"{questionnaire}.score.{score}" if name in asked else name


def _answers(session: SessionRecord) -> Iterator[dict[str, Any]]:
    for asked in occasions(session):
        about = asked_in(session).get(asked.questionnaire, {})
        items = [item["name"] for item in about.get("items", ())]
        # Answers that are not among the items can only be from an older recording.
        for name in dict.fromkeys([*items, *asked.answers]):
            value, time = asked.answers.get(name, (None, asked.ended))
            missing = DECLINED if name in asked.answers else asked.silent
            yield {
                **_when(session, asked),
                "language": str(about.get("language", "")),
                "item": name,
                "value": _number(value),
                "text": value if isinstance(value, str) else "",
                "missing": missing if value is None else "",
                "time": time,
            }


def _scores(session: SessionRecord) -> Iterator[dict[str, Any]]:
    for asked in occasions(session):
        for name, value in asked.scores.items():
            yield {
                **_when(session, asked),
                "score": name,
                "value": _number(value),
                "missing": asked.silent if value is None else "",
                "time": asked.ended,
            }


def _when(session: SessionRecord, asked: Occasion) -> dict[str, Any]:
    when = {name: getattr(asked, name) for name in ("step", "block", "trial", "questionnaire")}
    return when | {"version": version_of(session, asked.questionnaire)}


def _number(value: object) -> float:
    return float(value) if isinstance(value, int | float) else np.nan
