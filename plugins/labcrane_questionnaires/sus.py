"""The system usability scale (Brooke 1996, 2013)."""

from collections.abc import Mapping, Sequence

from labcrane import ProtocolError, Questionnaire
from labcrane.core import Answers, Item, Score, numeric_answers
from labcrane_questionnaires.settings import SUS_SPAN, LabText, SusSettings

STATEMENTS = (
    "I think that I would like to use this system frequently.",
    "I found the system unnecessarily complex.",
    "I thought the system was easy to use.",
    "I think that I would need the support of a technical person to be able to use this system.",
    "I found the various functions in this system were well integrated.",
    "I thought there was too much inconsistency in this system.",
    "I would imagine that most people would learn to use this system very quickly.",
    "I found the system very cumbersome to use.",
    "I felt very confident using the system.",
    "I needed to learn a lot of things before I could get going with this system.",
)
ENGLISH = LabText(
    title="System usability scale",
    rights="Digital Equipment Corporation 1986; John Brooke leaves its use free, with a citation",
    items=STATEMENTS,
    left="Strongly disagree",
    right="Strongly agree",
)
NAMES = tuple(f"statement_{number}" for number in range(1, len(STATEMENTS) + 1))


class Sus(Questionnaire):
    """Ten statements from 1 to 5; the score goes from 0 to 100 and is not a percentage.

    Odd statements contribute their rating minus 1, even statements 5 minus their rating. The score
    is the sum times 2.5. A missing answer makes the score NaN.
    """

    scores = (Score("total", 0.0, 100.0),)

    def __init__(self, settings: SusSettings) -> None:
        text = settings.text or ENGLISH
        if len(text.items) != len(NAMES):
            raise ProtocolError(
                f"SUS has {len(NAMES)} statements, and the lab's file has {len(text.items)}"
            )
        self.title, self.rights = text.title or ENGLISH.title, text.rights
        self._text = text

    def items(self) -> Sequence[Item]:
        ends = (self._text.left, self._text.right)
        words = tuple(self._text.words.items())
        return [
            Item(name, asked, "scale", *SUS_SPAN, *ends, words=words)
            for name, asked in zip(NAMES, self._text.items, strict=True)
        ]

    def score(self, answers: Answers) -> Mapping[str, float]:
        ratings = numeric_answers(answers, NAMES)
        odd, even = ratings[::2], ratings[1::2]
        return {"total": 2.5 * (sum(r - 1.0 for r in odd) + sum(5.0 - r for r in even))}
