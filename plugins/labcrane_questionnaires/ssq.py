"""The simulator sickness questionnaire (Kennedy et al. 1993): its scoring."""

from collections.abc import Mapping

from labcrane.core import Answers, Score, numeric_answers
from labcrane_questionnaires.lab_scale import LabScale

# Items by their numbers in the publication. Many copies leave item 8, nausea, out of
# disorientation; the publication has seven items in each subscale.
SUBSCALES = {
    "nausea": ((1, 6, 7, 8, 9, 15, 16), 9.54),
    "oculomotor": ((1, 2, 3, 4, 5, 9, 11), 7.58),
    "disorientation": ((5, 8, 10, 11, 12, 13, 14), 13.92),
}
TOTAL = 3.74
WORST = 3.0


class Ssq(LabScale):
    """Sixteen symptoms from 0 (none) to 3 (severe).

    A subscale is the sum of its seven items times its weight; the total is the three sums times
    3.74. A missing answer makes every score that needs it NaN. Ask the questionnaire before the
    session, too, because baselines are not zero.
    """

    usual_title = "Simulator sickness questionnaire"
    names = tuple(f"symptom_{number}" for number in range(1, 17))
    span = (0.0, WORST, 1.0)
    scores = (
        *(Score(name, 0.0, WORST * 7 * weight) for name, (_, weight) in SUBSCALES.items()),
        Score("total", 0.0, WORST * 21 * TOTAL),
    )

    def score(self, answers: Answers) -> Mapping[str, float]:
        sums = {
            name: sum(numeric_answers(answers, [f"symptom_{item}" for item in items]))
            for name, (items, _) in SUBSCALES.items()
        }
        scores = {name: sums[name] * weight for name, (_, weight) in SUBSCALES.items()}
        return {**scores, "total": sum(sums.values()) * TOTAL}
