"""A questionnaire in the terminal."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from labcrane.core.items import Item, in_order
from labcrane.core.records import Event, Value
from labcrane.core.roles import Questionnaire


@dataclass(frozen=True, slots=True)
class Sheet:
    """The questionnaire under way."""

    name: str
    questionnaire: Questionnaire
    order: str = ""
    turned: str = ""

    def items(self) -> Sequence[Item]:
        """Return its items, as they are shown according to the record."""
        return in_order(self.questionnaire.items(), self.order, self.turned)

    @staticmethod
    def read(item: Item, said: str) -> float | str | None:
        """Return the typed answer, not yet checked; a choice by its label; a dash declines."""
        if said == "-":
            return None
        if item.kind == "choice" and said not in item.choices:
            return dict(zip(item.labels, item.choices, strict=False)).get(said, said)
        if item.kind in {"choice", "text"}:
            return said
        try:
            return float(said.replace(",", "."))
        except ValueError:
            return said  # which the item refuses

    def answer(self, item: Item, value: Value) -> str:
        """Return the words of the action that gives an answer."""
        given = {"questionnaire": self.name, "item": item.name, "value": value}
        return json.dumps(given, ensure_ascii=False)


@dataclass(frozen=True, slots=True)
class Sheets:
    """All questionnaires of a study."""

    questionnaires: Mapping[str, Questionnaire]

    def __call__(self, event: Event, sheet: Sheet | None) -> Sheet | None:
        """Return the questionnaire under way after ``event``."""
        if event.name == "questionnaire.start":
            name = str(event.data["questionnaire"])
            asked = self.questionnaires.get(name)
            order, turned = (str(event.data.get(key, "")) for key in ("order", "turned"))
            return Sheet(name, asked, order, turned) if asked else None
        return None if event.name == "questionnaire.end" else sheet
