"""A console whose participant answers what is asked."""

import json
from collections.abc import Mapping

from governed import Willing

from labcrane.core import Event
from labcrane.testing import Command, Order


class Answering(Willing):
    """Answers what is asked, item by item; ends the session at the questionnaire ``leaves``."""

    def __init__(self, answers: Mapping[str, Mapping[str, object]], leaves: str = "") -> None:
        super().__init__()
        self._answers, self._leaves = answers, leaves
        self._waiting: list[Command] = []

    def given(self, name: str) -> Mapping[str, object]:
        """Return the answers to a questionnaire, by item."""
        return self._answers.get(name, {})

    def report(self, event: Event) -> None:
        super().report(event)
        if event.name != "questionnaire.start":
            return
        name = event.data["questionnaire"]
        for item, value in self.given(name).items():
            answer = {"questionnaire": name, "item": item, "value": value}
            self._waiting.append(Command(Order.ANSWER, json.dumps(answer), "participant"))
        self._waiting.append(Command(Order.END if name == self._leaves else Order.SUBMIT))

    def commands(self) -> list[Command]:
        return [*super().commands(), *([self._waiting.pop(0)] if self._waiting else [])]
