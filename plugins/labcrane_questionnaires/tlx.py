"""The NASA task load index (Hart and Staveland 1988; NTRS 20000021488)."""

import itertools
from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from labcrane import Questionnaire
from labcrane.core import Answers, Item, Score, numeric_answers
from labcrane_questionnaires.settings import TlxSettings

SCALES = {
    "mental": (
        "Mental demand",
        "How much mental and perceptual activity was required? Was the task easy or demanding, "
        "simple or complex, exacting or forgiving?",
    ),
    "physical": (
        "Physical demand",
        "How much physical activity was required? Was the task easy or demanding, slow or brisk, "
        "slack or strenuous, restful or laborious?",
    ),
    "temporal": (
        "Temporal demand",
        "How much time pressure did you feel due to the rate or pace at which the tasks or task "
        "elements occurred? Was the pace slow and leisurely or rapid and frantic?",
    ),
    "performance": (
        "Performance",
        "How successful do you think you were in accomplishing the goals of the task set by the "
        "experimenter (or yourself)? How satisfied were you with your performance in "
        "accomplishing these goals?",
    ),
    "effort": (
        "Effort",
        "How hard did you have to work (mentally and physically) to accomplish your level of "
        "performance?",
    ),
    "frustration": (
        "Frustration level",
        "How insecure, discouraged, irritated, stressed and annoyed versus secure, gratified, "
        "content, relaxed and complacent did you feel during the task?",
    ),
}
PAIRS = tuple(itertools.combinations(SCALES, 2))


class NasaTlx(Questionnaire):
    """Six ratings from 0 to 100 in steps of 5, and on request the fifteen pairs.

    ``raw`` is the mean of the six; ``weighted`` is the sum of rating times tally, over 15, the
    tally being how often a scale was chosen. Performance runs from good (0) to poor (100) and is
    not turned round. A score that needs a missing answer is NaN.
    """

    title = "NASA task load index"
    rights = "NASA Ames Research Center; a work of the US Government, public domain in the US"

    def __init__(self, settings: TlxSettings) -> None:
        self._weighted = settings.weighted
        names = ("raw", "weighted") if settings.weighted else ("raw",)
        self.scores = tuple(Score(name, 0.0, 100.0) for name in names)

    def items(self) -> Sequence[Item]:
        ratings = [
            Item(
                name,
                f"{title}: {text}",
                highest=100.0,
                step=5.0,
                left="Good" if name == "performance" else "Low",
                right="Poor" if name == "performance" else "High",
            )
            for name, (title, text) in SCALES.items()
        ]
        if not self._weighted:
            return ratings
        return ratings + [
            Item(
                f"{one}_or_{other}",
                "Which contributed more to the workload of the task: "
                f"{SCALES[one][0].lower()} or {SCALES[other][0].lower()}?",
                "choice",
                choices=(one, other),
            )
            for one, other in PAIRS
        ]

    def score(self, answers: Answers) -> Mapping[str, float]:
        ratings = np.array(numeric_answers(answers, tuple(SCALES)))
        scores = {"raw": float(ratings.mean())}
        if self._weighted:
            chosen = [answers.get(f"{one}_or_{other}") for one, other in PAIRS]
            tally = Counter(chosen)
            weights = np.array([tally[name] for name in SCALES], np.float64)
            whole = np.nan if None in tally else float(ratings @ weights) / len(PAIRS)
            scores["weighted"] = whole
        return scores
