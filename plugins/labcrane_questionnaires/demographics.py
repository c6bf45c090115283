"""Demographics that a study reports of its participants; nothing that could name one."""

from collections.abc import Mapping, Sequence

from labcrane import Questionnaire
from labcrane.core import Answers, Item
from labcrane_questionnaires.settings import DemographicsSettings

WORDS = {
    "en": {
        "title": "About you",
        "age": "How old are you, in years?",
        "gender": "Your gender",
        "sex": "Your sex",
        "handedness": "Which hand do you write with?",
        "experience": "For how many years have you operated cranes or manipulators?",
        "gaming": "How many hours a week do you play computer games?",
    },
    "de": {
        "title": "Zu Ihrer Person",
        "age": "Wie alt sind Sie, in Jahren?",
        "gender": "Ihr Geschlecht (Gender)",
        "sex": "Ihr Geschlecht",
        "handedness": "Mit welcher Hand schreiben Sie?",
        "experience": "Seit wie vielen Jahren bedienen Sie Kräne oder Manipulatoren?",
        "gaming": "Wie viele Stunden in der Woche spielen Sie Computerspiele?",
        "female": "weiblich",
        "male": "männlich",
        "other": "divers",
        "left": "links",
        "right": "rechts",
        "both": "beide",
    },
}


class Demographics(Questionnaire):
    """Age, gender, handedness, experience; every answer can be declined. It has no score."""

    rights = "labcrane, Apache-2.0"

    def __init__(self, settings: DemographicsSettings) -> None:
        self._asked = settings.ask
        self._words = WORDS[settings.language]
        self.title = self._words["title"]

    def items(self) -> Sequence[Item]:
        words = self._words
        items = {
            "age": Item("age", words["age"], "number", 16.0, 99.0, 1.0),
            "gender": self._choice("gender", ("female", "male", "other")),
            "sex": self._choice("sex", ("female", "male", "other")),
            "handedness": self._choice("handedness", ("left", "right", "both")),
            "experience": Item("experience", words["experience"], "number", 0.0, 70.0, 0.0),
            "gaming": Item("gaming", words["gaming"], "number", 0.0, 168.0, 0.0),
        }
        return [items[name] for name in self._asked]

    def _choice(self, name: str, choices: tuple[str, ...]) -> Item:
        labels = tuple(self._words.get(choice, choice) for choice in choices)
        return Item(name, self._words[name], "choice", choices=choices, labels=labels)

    def score(self, answers: Answers) -> Mapping[str, float]:
        return {}
