"""my_part: questions for the participant."""

from collections.abc import Mapping, Sequence

from pydantic import Field

from labcrane import Offer, Questionnaire, Settings, hookimpl, offer
from labcrane.core import Answers, Item, Score, numeric_answers

labcrane_api = 1


class MyPartSettings(Settings):
    """Settings of my_part; a protocol writes them next to ``use``."""

    steps: int = Field(default=7, ge=2, le=101)
    """How many answers each scale has."""


class MyPart(Questionnaire):
    """Two scales and their mean."""

    title = "How was it?"
    rights = "words of our own"
    scores = (Score("ease", 0.0, 1.0),)

    def __init__(self, settings: MyPartSettings) -> None:
        self._highest = settings.steps - 1.0

    def items(self) -> Sequence[Item]:
        return [
            self._scale("easy", "How easy was the task?"),
            self._scale("sure", "How sure were you of your movements?"),
        ]

    def _scale(self, name: str, text: str) -> Item:
        return Item(name, text, highest=self._highest, left="not at all", right="very")

    def score(self, answers: Answers) -> Mapping[str, float]:
        easy, sure = numeric_answers(answers, ("easy", "sure"))  # NaN where there is no answer
        return {"ease": (easy + sure) / 2.0 / self._highest}


@hookimpl
def labcrane_questionnaires() -> list[Offer[Questionnaire]]:
    return [offer("my_part", MyPartSettings, MyPart)]
