"""The system usability scale (Brooke 1996, 2013)."""

from collections.abc import Mapping, Sequence

from labcrane import Questionnaire
from labcrane.core import Answers, Item, Score, numeric_answers

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
NAMES = tuple(f"statement_{number}" for number in range(1, len(STATEMENTS) + 1))


class Sus(Questionnaire):
    """Ten statements from 1 to 5; the score goes from 0 to 100 and is no percentage.

    Odd statements count their rating less 1, even ones 5 less their rating, the sum is taken 2.5
    times. A missing answer makes the score NaN.
    """

    title = "System usability scale"
    rights = "Digital Equipment Corporation 1986; John Brooke leaves its use free, with a citation"
    scores = (Score("total", 0.0, 100.0),)

    def items(self) -> Sequence[Item]:
        return [
            Item(name, text, "scale", 1.0, 5.0, 1.0, "Strongly disagree", "Strongly agree")
            for name, text in zip(NAMES, STATEMENTS, strict=True)
        ]

    def score(self, answers: Answers) -> Mapping[str, float]:
        ratings = numeric_answers(answers, NAMES)
        odd, even = ratings[::2], ratings[1::2]
        return {"total": 2.5 * (sum(r - 1.0 for r in odd) + sum(5.0 - r for r in even))}
