"""Questionnaires of the recordings: a table and its description for each, under phenotype."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from labcrane.analysis import Participant, answers_of, asked_in, scores_of
from labcrane_bids.files import label, write_json, write_tsv

if TYPE_CHECKING:
    import pandas as pd

PHENOTYPE = "phenotype"
KEYS = ["session", "step", "block", "trial"]

COLUMNS: Mapping[str, Mapping[str, str]] = {
    "session_id": {"Description": "session in which it was asked"},
    "block": {"Description": "block under way or before it; 0 before the first"},
    "trial": {"Description": "trial that it follows; n/a where it follows none"},
    "version": {"Description": "what was asked: offer, plugin and version"},
    "language": {"Description": "language of the questions"},
    "missing": {"Description": "answers that are missing, and why"},
}


class Phenotype:
    """Takes what each participant answered; there is one row for each time that it was asked."""

    def __init__(self) -> None:
        self._rows: dict[str, list[dict[str, Any]]] = {}
        self._about: dict[str, Mapping[str, Any]] = {}

    def add(self, subject: str, participant: Participant) -> None:
        """Take up one participant's answers and scores."""
        for _, session in participant.sessions():
            self._about |= asked_in(session)
        answers, scores = answers_of(participant), scores_of(participant)
        for name in dict.fromkeys(answers["questionnaire"]):
            own = answers[answers["questionnaire"] == name]
            worth = scores[scores["questionnaire"] == name]
            for _, times in own.groupby(KEYS, dropna=False, sort=False):
                row = _row(subject, times)
                self._rows.setdefault(str(name), []).append(row | _scored(times, worth))

    def write(self, folder: Path) -> Sequence[str]:
        """Write the tables; return their names."""
        import pandas as pd

        for name, rows in self._rows.items():
            (folder / PHENOTYPE).mkdir(exist_ok=True)
            table = pd.DataFrame(rows)
            for column in ("block", "trial"):
                table[column] = table[column].astype("Int64")
            stem = label_of(name)
            write_tsv(folder / PHENOTYPE / f"{stem}.tsv", table)
            about = self._described(name, list(map(str, table)))
            write_json(folder / PHENOTYPE / f"{stem}.json", about)
        return [label_of(name) for name in self._rows]

    def _described(self, name: str, columns: Sequence[str]) -> dict[str, Any]:
        about = self._about.get(name, {})
        items = {item["name"]: _item(item) for item in about.get("items", ())}
        scores = {
            f"score_{score['name']}": {
                "Description": f"score {score['name']}",
                "Minimum": score["lowest"],
                "Maximum": score["highest"],
            }
            for score in about.get("scores", ())
        }
        known = {**COLUMNS, **items, **scores}
        described = {
            column: dict(known.get(column, {"Description": column.replace("_", " ")}))
            for column in columns
            if column != "participant_id"
        }
        tool = {"Description": str(about.get("title") or name)}
        return {"MeasurementToolMetadata": tool, **described}


def label_of(name: str) -> str:
    """Return what the table of a questionnaire is called."""
    return "_".join(filter(None, map(label, name.split("_"))))


def _row(subject: str, answers: "pd.DataFrame") -> dict[str, Any]:
    rows = answers.to_dict("records")
    first = rows[0]
    # A line of the table is one row, whatever somebody wrote.
    given = {row["item"]: " ".join(row["text"].split()) or _known(row["value"]) for row in rows}
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


def _known(value: float) -> float | None:
    return None if math.isnan(value) else value


def _scored(answers: "pd.DataFrame", scores: "pd.DataFrame") -> dict[str, Any]:
    """Return the scores of the time at which ``answers`` were given."""
    rows = scores.merge(answers[["session", "step", "trial"]].drop_duplicates())
    named = zip(rows["score"], rows["value"], strict=True)
    return {f"score_{name}": value for name, value in named}


def _item(item: Mapping[str, Any]) -> dict[str, Any]:
    about: dict[str, Any] = {"Description": item["text"]}
    if item["kind"] == "choice":
        labels = item["labels"] or item["choices"]
        about["Levels"] = dict(zip(item["choices"], labels, strict=True))
    elif item["kind"] in {"scale", "number"}:
        about |= {"Minimum": item["lowest"], "Maximum": item["highest"]}
        if item["left"] or item["right"]:
            about["Description"] += f" ({item['left']} to {item['right']})"
    return about
