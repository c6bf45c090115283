"""Questionnaires of the recordings: a table and its description for each.

BIDS 1.11 allows one row per participant in ``phenotype``. A questionnaire that a participant
answered more often is in ``beh`` instead: one table per session, one row per time, with its trial.
"""

import json
import math
from collections.abc import Hashable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from labcrane.analysis import Participant, asked_in, scores_of
from labcrane.core import Item
from labcrane_bids.files import EntityLabels, label, write_json, write_tsv

if TYPE_CHECKING:
    import pandas as pd

PHENOTYPE = "phenotype"
FALLBACK = "questionnaire"
DEMOGRAPHICS = "demographics "
"""How the version of such a questionnaire begins: with its offer."""

CODES = {"female": "F", "male": "M", "other": "O", "left": "L", "right": "R", "both": "A"}
OLDEST = 89
"""Age in years above which BIDS recommends not to state the exact age, because it could identify a
person."""

KEYS = ["session", "step", "block", "trial"]

ITEM, SCORE = "item_", "score_"
"""How the columns of items that are called as other columns begin, and those of scores."""

COLUMNS: Mapping[str, Mapping[str, str]] = {
    "session_id": {"Description": "session in which it was asked"},
    "block": {"Description": "block under way or before it; 0 before the first"},
    "trial": {"Description": "trial that it follows; n/a where it follows none"},
    "version": {"Description": "what was asked: offer, plugin and version"},
    "language": {"Description": "language of the questions"},
    "missing": {"Description": "answers that are missing, and why"},
}


class Phenotype:
    """Answers and scores of all participants, one row for each time that they were asked.

    The column of an item is called as the item; one that is called as another column, or begins as
    they do, has ``item_`` before it: ``item_trial``.
    """

    def __init__(self) -> None:
        self._rows: dict[str, list[dict[str, Any]]] = {}
        self._about: dict[str, Mapping[str, Any]] = {}
        self._forms: dict[tuple[str, str], dict[str, list[str]]] = {}
        self._about_person: set[str] = set()

    def add(self, subject: str, participant: Participant, answers: "pd.DataFrame") -> None:
        """Take up one participant's answers and scores."""
        for number, session in participant.sessions():
            for name, about in asked_in(session).items():
                self._about[name] = _with_earlier(self._about.get(name, {}), about)
                for item in about["items"]:
                    forms = self._forms.setdefault((name, item["name"]), {})
                    form = json.dumps(_item(item), ensure_ascii=False)
                    forms.setdefault(form, []).append(f"{subject}_ses-{number:02}")
        scores = scores_of(participant)
        for name in dict.fromkeys(answers["questionnaire"]):
            own = answers[answers["questionnaire"] == name]
            if _asks_about_person(own["version"].iloc[0]):
                self._about_person.add(str(name))
            worth = scores[scores["questionnaire"] == name]
            for _, times in own.groupby(KEYS, dropna=False, sort=False):
                row = _row(subject, times)
                self._rows.setdefault(str(name), []).append(row | _scored(times, worth))

    def write(self, folder: Path) -> Sequence[str]:
        """Write the tables; return what they would be called in ``phenotype``."""
        import pandas as pd

        task_of, table_of = EntityLabels(fallback=FALLBACK), EntityLabels(label_of, FALLBACK)
        tables = [table_of(name) for name in self._rows]
        for name, rows in self._rows.items():
            table = pd.DataFrame(rows)
            for column in ("block", "trial"):
                table[column] = table[column].astype("Int64")
            about = self._described(name, list(map(str, table)))
            if table["participant_id"].duplicated().any():
                about = {"TaskName": task_of(name), "TaskDescription": self._title(name), **about}
                _write_repeated(folder, f"task-{task_of(name)}_beh", table, about)
                continue
            (folder / PHENOTYPE).mkdir(exist_ok=True)
            write_tsv(folder / PHENOTYPE / f"{table_of(name)}.tsv", table)
            about = {"MeasurementToolMetadata": {"Description": self._title(name)}, **about}
            write_json(folder / PHENOTYPE / f"{table_of(name)}.json", about)
        return tables

    def _title(self, name: str) -> str:
        return str(self._about.get(name, {}).get("title") or name)

    def _described(self, name: str, columns: Sequence[str]) -> dict[str, Any]:
        about = self._about.get(name, {})
        items = {
            _column(item["name"]): _of_forms(self._forms[name, item["name"]])
            for item in about.get("items", ())
        }
        scores = {
            f"{SCORE}{score['name']}": {
                "Description": f"score {score['name']}",
                "Minimum": score["lowest"],
                "Maximum": score["highest"],
            }
            for score in about.get("scores", ())
        }
        if name in self._about_person and "age" in items:
            items["age"]["Description"] += f"; {OLDEST}+ for {OLDEST} and above"
        known = {**COLUMNS, **items, **scores}
        return {
            column: dict(known.get(column, {"Description": column.replace("_", " ")}))
            for column in columns
            if column != "participant_id"
        }


def label_of(name: str) -> str:
    """Return the name of a questionnaire's table."""
    return "_".join(filter(None, map(label, name.split("_"))))


def _write_repeated(
    folder: Path, stem: str, table: "pd.DataFrame", about: Mapping[str, Any]
) -> None:
    """Write a table for each session, and one description for all of them."""
    for (subject, session), rows in table.groupby(["participant_id", "session_id"]):
        beh = folder / str(subject) / str(session) / "beh"
        beh.mkdir(exist_ok=True)
        own = rows.drop(columns=["participant_id", "session_id"])
        write_tsv(beh / f"{subject}_{session}_{stem}.tsv", own)
    write_json(folder / f"{stem}.json", {k: v for k, v in about.items() if k != "session_id"})


def _column(item: str) -> str:
    """Return what the column of an item is called, which no other column is."""
    other = item in COLUMNS or item == "participant_id" or item.startswith((ITEM, SCORE))
    return f"{ITEM}{item}" if other else item


def _with_earlier(earlier: Mapping[str, Any], about: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return what is known of a questionnaire, with items and scores that it had before."""
    merged = {
        key: list({each["name"]: each for each in (*earlier.get(key, ()), *about[key])}.values())
        for key in ("items", "scores")
    }
    return {**about, **merged}


def _of_forms(forms: Mapping[str, Sequence[str]]) -> dict[str, Any]:
    """Return the description of an item; where an amendment changed it, who was asked what."""
    described = [(json.loads(form), asked) for form, asked in forms.items()]
    if len(described) == 1:
        return dict(described[0][0])
    levels = {}
    if all("Levels" in about for about, _ in described):  # numbers have no levels
        levels = {key: word for about, _ in described for key, word in about["Levels"].items()}
    said = "; ".join(f"of {', '.join(asked)}: {_in_words(about)}" for about, asked in described)
    return {"Description": f"asked in {len(described)} forms; {said}"} | (
        {"Levels": levels} if levels else {}
    )


def _in_words(about: Mapping[str, Any]) -> str:
    if "Levels" in about:
        return f"{about['Description']} [{', '.join(about['Levels'])}]"
    if "Minimum" in about:
        return f"{about['Description']} [{about['Minimum']:g} to {about['Maximum']:g}]"
    return f"{about['Description']} [words]"


def demographics_of(answers: "pd.DataFrame") -> dict[str, str]:
    """Return age, sex and handedness as they were first answered, in the codes of BIDS."""
    told: dict[str, str] = {}
    for row in answers[answers["version"].str.startswith(DEMOGRAPHICS)].to_dict("records"):
        item, value = row["item"], row["value"]
        code = CODES.get(row["text"]) if item in {"sex", "handedness"} else None
        if item == "age" and not math.isnan(value):
            code = age_code(value)
        if code:
            told.setdefault(item, code)
    return told


def age_code(years: float) -> str:
    """Return an age as BIDS writes it; ages from ``OLDEST`` share one code."""
    return f"{years:g}" if years < OLDEST else f"{OLDEST}+"


def _row(subject: str, answers: "pd.DataFrame") -> dict[str, Any]:
    rows = answers.to_dict("records")
    first = rows[0]
    # Line breaks in an answer must not break the table's row.
    given = {_column(row["item"]): " ".join(row["text"].split()) or _answer(row) for row in rows}
    missing = [f"{row['item']}: {row['missing']}" for row in rows if row["missing"]]
    return {
        "participant_id": subject,
        "session_id": f"ses-{int(first['session']):02}",
        "block": first["block"],
        "trial": _known(first["trial"]),
        "version": first["version"],
        "language": first["language"] or None,
        "missing": "; ".join(missing) or None,
        **given,
    }


def _answer(row: Mapping[Hashable, Any]) -> float | str | None:
    value = _known(row["value"])
    if value is not None and row["item"] == "age" and _asks_about_person(row["version"]):
        return age_code(value)
    return value


def _asks_about_person(version: str) -> bool:
    return version.startswith(DEMOGRAPHICS)


def _known(value: float) -> float | None:
    return None if math.isnan(value) else value


def _scored(answers: "pd.DataFrame", scores: "pd.DataFrame") -> dict[str, Any]:
    """Return the scores of the time at which ``answers`` were given."""
    rows = scores.merge(answers[["session", "step", "trial"]].drop_duplicates())
    named = zip(rows["score"], rows["value"], strict=True)
    return {f"{SCORE}{name}": value for name, value in named}


def _item(item: Mapping[str, Any]) -> dict[str, Any]:
    about: dict[str, Any] = {"Description": item["text"]}
    if item["kind"] == "choice":
        labels = item["labels"] or item["choices"]
        about["Levels"] = dict(zip(item["choices"], labels, strict=True))
    elif item["kind"] in {"scale", "number"}:
        about |= {"Minimum": item["lowest"], "Maximum": item["highest"]}
        if meanings := Item(**item).meanings:
            about["Description"] += f" ({meanings})"
    return about
