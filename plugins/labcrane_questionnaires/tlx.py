"""The NASA task load index (Hart and Staveland 1988; NTRS 20000021488)."""

import itertools
from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from labcrane import Questionnaire
from labcrane.core import Answers, Item, Score, numeric_answers
from labcrane_questionnaires.settings import TlxSettings, TlxText

NAMES = ("mental", "physical", "temporal", "performance", "effort", "frustration")
PAIRS = tuple(itertools.combinations(NAMES, 2))
ENGLISH = TlxText(
    title="NASA task load index",
    rights="NASA Ames Research Center; a work of the US Government, public domain in the US",
    items=(
        "Mental demand: How much mental and perceptual activity was required (e.g. thinking, "
        "deciding, calculating, remembering, looking, searching, etc.)? Was the task easy or "
        "demanding, simple or complex, exacting or forgiving?",
        "Physical demand: How much physical activity was required (e.g. pushing, pulling, turning, "
        "controlling, activating, etc.)? Was the task easy or demanding, slow or brisk, slack or "
        "strenuous, restful or laborious?",
        "Temporal demand: How much time pressure did you feel due to the rate or pace at which the "
        "tasks or task elements occurred? Was the pace slow and leisurely or rapid and frantic?",
        "Performance: How successful do you think you were in accomplishing the goals of the task "
        "set by the experimenter (or yourself)? How satisfied were you with your performance in "
        "accomplishing these goals?",
        "Effort: How hard did you have to work (mentally and physically) to accomplish your level "
        "of performance?",
        "Frustration level: How insecure, discouraged, irritated, stressed and annoyed versus "
        "secure, gratified, content, relaxed and complacent did you feel during the task?",
    ),
    left="Low",
    right="High",
    performance=("Good", "Poor"),
    pair="Which contributed more to the workload of the task: {one} or {other}?",
)


class NasaTlx(Questionnaire):
    """Six ratings from 0 to 100 in steps of 5, and on request the fifteen pairs.

    Order and sides of the pairs are drawn by chance.

    ``raw`` is the mean of the six; ``weighted`` is the sum of rating times tally, over 15, the
    tally being how often a scale was chosen. Performance runs from good (0) to poor (100) and is
    not turned round. A score that needs a missing answer is NaN.
    """

    def __init__(self, settings: TlxSettings) -> None:
        self._text = text = settings.text or ENGLISH
        self.title, self.rights = text.title or ENGLISH.title, text.rights
        self._weighted = settings.weighted
        names = ("raw", "weighted") if settings.weighted else ("raw",)
        self.scores = tuple(Score(name, 0.0, 100.0) for name in names)

    def items(self) -> Sequence[Item]:
        text = self._text
        titles = {
            name: item.partition(": ")[0] for name, item in zip(NAMES, text.items, strict=True)
        }
        ends = dict.fromkeys(NAMES, (text.left, text.right)) | {"performance": text.performance}
        ratings = [
            Item(name, asked, "scale", 0.0, 100.0, 5.0, *ends[name], numbered=False)
            for name, asked in zip(NAMES, text.items, strict=True)
        ]
        if not self._weighted:
            return ratings
        return ratings + [
            Item(
                f"{one}_or_{other}",
                text.pair.format(one=titles[one], other=titles[other]),
                "choice",
                choices=(one, other),
                labels=(titles[one], titles[other]),
                card=True,
                turned=text.pair.format(one=titles[other], other=titles[one]),
            )
            for one, other in PAIRS
        ]

    def score(self, answers: Answers) -> Mapping[str, float]:
        ratings = np.array(numeric_answers(answers, NAMES))
        scores = {"raw": float(ratings.mean())}
        if self._weighted:
            chosen = [answers.get(f"{one}_or_{other}") for one, other in PAIRS]
            tally = Counter(chosen)
            weights = np.array([tally[name] for name in NAMES], np.float64)
            whole = np.nan if None in tally else float(ratings @ weights) / len(PAIRS)
            scores["weighted"] = whole
        return scores
