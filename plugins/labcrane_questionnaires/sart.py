"""The situation awareness rating technique (Taylor 1990): its scoring."""

from collections.abc import Mapping

from labcrane.core import Answers, Score, numeric_answers
from labcrane_questionnaires.lab_scale import LabScale

DEMAND = ("instability", "complexity", "variability")
SUPPLY = ("arousal", "concentration", "division", "capacity")
UNDERSTANDING = ("quantity", "quality", "familiarity")


class Sart(LabScale):
    """Ten dimensions from 1 to 7, the lab's words in the order demand, supply, understanding.

    The total is understanding less the difference of demand and supply, -14 to 46. A missing
    answer makes the scores that need it NaN.
    """

    usual_title = "Situation awareness rating technique"
    names = (*DEMAND, *SUPPLY, *UNDERSTANDING)
    span = (1.0, 7.0, 1.0)
    scores = (
        Score("demand", 3.0, 21.0),
        Score("supply", 4.0, 28.0),
        Score("understanding", 3.0, 21.0),
        Score("total", -14.0, 46.0),
    )

    def score(self, answers: Answers) -> Mapping[str, float]:
        demand, supply, understanding = (
            sum(numeric_answers(answers, names)) for names in (DEMAND, SUPPLY, UNDERSTANDING)
        )
        return {
            "demand": demand,
            "supply": supply,
            "understanding": understanding,
            "total": understanding - (demand - supply),
        }
