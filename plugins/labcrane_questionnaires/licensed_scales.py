"""Slots for single scales whose words are licensed: Borg's and the Karolinska sleepiness scale."""

from collections.abc import Callable, Mapping

from labcrane import Questionnaire
from labcrane.core import Answers, Score, numeric_answers
from labcrane_questionnaires.lab_scale import LabScale
from labcrane_questionnaires.settings import LabText

BEYOND = 20.0
"""Largest rating on CR10 that is accepted: twice the strongest experience so far."""


class _Slot(LabScale):
    """One rating, which is its own score."""

    names = ("rating",)

    def score(self, answers: Answers) -> Mapping[str, float]:
        return {"rating": numeric_answers(answers, self.names)[0]}


class BorgCr10(_Slot):
    """Borg's category-ratio scale: any number from 0, with words up to 10.

    Decimals belong to it, and numbers above 10 where something is stronger than ever before.
    """

    usual_title = "Borg CR10"
    span = (0.0, BEYOND, 0.0)
    scores = (Score("rating", 0.0, BEYOND),)


class BorgRpe(_Slot):
    """Borg's rating of perceived exertion: 6 to 20."""

    usual_title = "Borg RPE"
    span = (6.0, 20.0, 1.0)
    scores = (Score("rating", 6.0, 20.0),)


class Kss(_Slot):
    """The Karolinska sleepiness scale: 1 to 9."""

    usual_title = "Karolinska sleepiness scale"
    span = (1.0, 9.0, 1.0)
    scores = (Score("rating", 1.0, 9.0),)


SLOTS: Mapping[str, Callable[[LabText], Questionnaire]] = {
    "borg_cr10": BorgCr10,
    "borg_rpe": BorgRpe,
    "kss": Kss,
}
