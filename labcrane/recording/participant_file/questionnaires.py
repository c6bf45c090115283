"""Answers and scores of a session's questionnaires, from its events."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from labcrane.recording.journal_reader import LoggedEvent, SessionLog
from labcrane.recording.participant_file.columns import write_attributes, write_numbers, write_texts

if TYPE_CHECKING:
    import h5py

ANSWER, END, SCORE = "questionnaire.answer", "questionnaire.end", "score."
"""Events with answers and scores, and the prefix of a score's name."""

TEXTS, NUMBERS = ("questionnaire", "kind", "item", "text"), ("value", "time", "step", "trial")


@dataclass(frozen=True, slots=True)
class Row:
    """One answer that held, or one score. ``trial`` is NaN where it follows none."""

    questionnaire: str
    kind: str
    item: str
    text: str
    value: float
    time: float
    step: float
    trial: float


def write_questionnaires(group: "h5py.Group", log: SessionLog) -> None:
    """Write one row per answer and score, in the order in which they came to hold."""
    rows = list(rows_of(log.events))
    for position, column in enumerate((*TEXTS, *NUMBERS)):
        values = [getattr(row, column) for row in rows]
        if column in TEXTS:
            write_texts(group, column, values)
        else:
            unit = "s" if column == "time" else "1"
            write_numbers(group, column, np.array(values, np.float64), unit)
        write_attributes(group[column], {"position": position})


def rows_of(events: "list[LoggedEvent]") -> Iterator[Row]:
    """Yield answers and scores; of an answer that was changed, the last one.

    All that were given are in the events.
    """
    held: dict[tuple[Any, ...], Row] = {}
    for event in events:
        if event.name == ANSWER:
            row = _row(event, "answer", event.data["item"], event.data["value"])
            key = (row.questionnaire, row.item, row.step, str(row.trial))
            held.pop(key, None)
            held[key] = row
        elif event.name == END:
            for name, value in event.data.items():
                if name.startswith(SCORE):
                    row = _row(event, "score", name.removeprefix(SCORE), value)
                    held[row.questionnaire, name, row.step, str(row.trial)] = row
    yield from held.values()


def _row(event: LoggedEvent, kind: str, item: str, value: Any) -> Row:
    data = event.data
    number = float(value) if isinstance(value, int | float) else np.nan
    text = value if isinstance(value, str) else ""
    trial = float(data.get("trial", np.nan))
    return Row(data["questionnaire"], kind, item, text, number, event.time, data["step"], trial)
