"""A questionnaire in the terminal."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from labcrane.core.items import Item, in_order
from labcrane.core.records import Event, Value
from labcrane.core.roles import Questionnaire


@dataclass(frozen=True, slots=True)
class Sheet:
    """The questionnaire that is asked now."""

    name: str
    questionnaire: Questionnaire
    order: str = ""
    turned: str = ""

    def items(self) -> Sequence[Item]:
        """Return its questions, as the record says that they are shown."""
        return in_order(self.questionnaire.items(), self.order, self.turned)

    @staticmethod
    def read(item: Item, said: str) -> float | str | None:
        """Return what was typed as an answer, not yet checked; a dash declines."""
        if said == "-":
            return None
        if item.kind in {"choice", "text"}:
            return said
        try:
            return float(said.replace(",", "."))
        except ValueError:
            return said  # which the item refuses

    def answer(self, item: Item, value: Value) -> str:
        """Return the words of the order that gives an answer."""
        given = {"questionnaire": self.name, "item": item.name, "value": value}
        return json.dumps(given, ensure_ascii=False)


@dataclass(frozen=True, slots=True)
class Sheets:
    """All questionnaires of a study."""

    questionnaires: Mapping[str, Questionnaire]

    def __call__(self, event: Event, sheet: Sheet | None) -> Sheet | None:
        """Return the questionnaire that is asked after ``event``."""
        if event.name == "questionnaire.start":
            name = str(event.data["questionnaire"])
            asked = self.questionnaires.get(name)
            order, turned = (str(event.data.get(key, "")) for key in ("order", "turned"))
            return Sheet(name, asked, order, turned) if asked else None
        return None if event.name == "questionnaire.end" else sheet


def sheet_line(event: Event) -> str | None:
    """Return what is printed of questionnaires and pages; None when nothing is."""
    data = event.data
    match event.name:
        case "questionnaire.start":
            return f"questionnaire: {data['title']} (on the participant's page, or q here)"
        case "questionnaire.refused":
            return f"not taken: {data['why']}"
        case "stop_rule.met":
            over = f"{data['questionnaire']} {data['score']} is {data['value']}"
            return f"STOP RULE: {over}, above {data['above']}; space to go on, e to end"
        case "page.denied":
            return f"refused: {data['why']}"
        case _:
            return None
