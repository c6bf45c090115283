"""The two ratings of the plug-in simulator (Typiak 2024), in words of labcrane's own."""

from collections.abc import Mapping, Sequence

from labcrane import Questionnaire
from labcrane.core import Answers, Item, Score, numeric_answers
from labcrane_questionnaires.settings import RatingSettings

HIGHEST = 10.0

WORDS = {
    ("subjective_accuracy", "en"): (
        "Accuracy",
        "How accurately did you work in the last test?",
        "Not at all",
        "Perfectly",
    ),
    ("subjective_accuracy", "de"): (
        "Genauigkeit",
        "Wie genau haben Sie im letzten Versuch gearbeitet?",
        "Gar nicht genau",
        "Vollkommen genau",
    ),
    ("situational_awareness", "en"): (
        "Situational awareness",
        "How well did you know what was going on around the machine in the last test?",
        "Not at all",
        "All the time",
    ),
    ("situational_awareness", "de"): (
        "Situationsbewusstsein",
        "Wie gut wussten Sie im letzten Versuch, was um die Maschine herum geschieht?",
        "Gar nicht",
        "Jederzeit",
    ),
}


class Rating(Questionnaire):
    """One rating from 0 to 10 after a test; the score is the tenth of it, 0 to 1."""

    rights = "labcrane, Apache-2.0; what is rated is from Typiak 2024, the words are not"
    scores = (Score("share", 0.0, 1.0),)

    def __init__(self, name: str, settings: RatingSettings) -> None:
        self.title, text, left, right = WORDS[name, settings.language]
        self._item = Item("rating", text, "scale", 0.0, HIGHEST, 1.0, left, right)

    def items(self) -> Sequence[Item]:
        return [self._item]

    def score(self, answers: Answers) -> Mapping[str, float]:
        return {"share": numeric_answers(answers, ["rating"])[0] / HIGHEST}
