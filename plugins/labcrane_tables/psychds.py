"""Psych-DS 1.0: CSV files with named keys, and a JSON-LD description of every column."""

import json
from collections.abc import Iterable
from pathlib import Path

from labcrane.analysis import (
    Exporter,
    Participant,
    answers_of,
    beside_trials,
    codebook_of,
    measures_of,
    scores_of,
)
from labcrane_tables.frames import Names
from labcrane_tables.settings import PsychDsSettings
from labcrane_tables.tables import joined, write_csv

OTHERS = ("questionnaires", "scores")
"""Tables in addition to that of movements."""


class PsychDs(Exporter):
    """One CSV file per participant and session of movements, of answers, and of scores.

    Streams stay in the participant files: Psych-DS is for tables that people read.
    """

    shared = ("dataset_description.json", "README.md")

    def __init__(self, settings: PsychDsSettings) -> None:
        self._settings = settings

    def export(self, participants: Iterable[Participant], folder: Path) -> None:
        (folder / "data").mkdir()
        variables: dict[str, dict[str, str]] = {}
        title = study = ""
        names = Names()
        for participant in participants:
            context = participant.context
            title, study = str(context.get("title", "")), str(context.get("study", ""))
            measures = beside_trials(measures_of(participant), participant)
            book = codebook_of(participant, measures)
            table = names.table(measures)
            for row in book[book["table"] == "trials"].itertuples(index=False):
                name = names.of(str(row.column))
                variables.setdefault(name, _variable(name, *map(str, row[2:])))
            for number, own in table.groupby("session"):
                subject = _key(participant.name)
                name = f"study-{_key(study)}_subject-{subject}_session-{number}_data.csv"
                write_csv(joined([own]), folder / "data" / name)
            for what, answers in zip(OTHERS, (answers_of, scores_of), strict=True):
                told = answers(participant)
                if told.empty:  # only the columns in a file are described
                    continue
                for row in book[book["table"] == what].itertuples(index=False):
                    name = str(row.column)
                    variables.setdefault(name, _variable(name, *map(str, row[2:])))
                for number, own in told.groupby("session"):
                    subject = _key(participant.name)
                    name = f"study-{_key(study)}_subject-{subject}_session-{number}_desc-{what}"
                    write_csv(joined([own]), folder / "data" / f"{name}_data.csv")
        description = {
            "@context": "https://schema.org/",
            "@type": "Dataset",
            "name": title,
            "description": self._settings.description or title,
            "schemaVersion": "Psych-DS 1.0",
            "variableMeasured": list(variables.values()),
        }
        text = json.dumps(description, indent=2, ensure_ascii=False) + "\n"
        (folder / "dataset_description.json").write_text(text, encoding="utf-8")
        (folder / "README.md").write_text(f"# {title}\n\nWritten by labcrane.\n", encoding="utf-8")


def _key(text: str) -> str:
    """Return a value of a file name's key: Psych-DS allows letters and digits."""
    return "".join(letter for letter in text if letter.isalnum())


def _variable(column: str, unit: str, description: str, source: str) -> dict[str, str]:
    about = {"@type": "PropertyValue", "name": column, "description": f"{description}; {source}"}
    return about | ({"unitText": unit} if unit else {})
