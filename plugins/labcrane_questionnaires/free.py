"""A questionnaire of the lab's own, written in the protocol."""

from collections.abc import Mapping, Sequence

from labcrane import Questionnaire
from labcrane.core import Answers, Item, Score, numeric_answers
from labcrane_questionnaires.settings import FreeSettings


class Free(Questionnaire):
    """The lab's questions; its scores are sums, NaN when an answer is missing."""

    def __init__(self, settings: FreeSettings) -> None:
        self.title = settings.title
        self.rights = settings.rights
        self._items = {question.name: question.item() for question in settings.questions}
        self._sums = settings.sums
        self.scores = tuple(
            Score(
                score,
                sum(self._items[name].lowest for name in names if name in self._items),
                sum(self._items[name].highest for name in names if name in self._items),
            )
            for score, names in settings.sums.items()  # the check reports unknown names
        )

    def items(self) -> Sequence[Item]:
        return list(self._items.values())

    def score(self, answers: Answers) -> Mapping[str, float]:
        return {score: sum(numeric_answers(answers, names)) for score, names in self._sums.items()}
