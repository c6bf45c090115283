"""Advice on what to practise next, and whether a scenario has been learned or worn out.

Rules of thumb with their evidence, not tests of significance; docs/indicator.md states them.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from labcrane.analysis.operator_tests import OperatorTest

WORDS = {
    "duration": "time: work faster",
    "object": "objects: keep clear of what is in the scene",
    "body": "bodies: keep clear of people",
    "overload_max": "overloads in the max direction: do not drive joints into their upper stops",
    "overload_min": "overloads in the min direction: do not drive joints into their lower stops",
    "accuracy": "felt accuracy: repeat slower, with feedback on what was hit",
    "awareness": "felt awareness: practise looking around, with more cameras",
}
FEWEST = 4
"""Runs of a scenario below which nothing is said of it."""

STEADY = 0.1
"""Spread of the last three times, as a share of their mean, at which an operator is at home."""

FALL = 5.0
"""Percentage points by which the last three runs are below the best three: fatigue."""

WINDOW = 3


@dataclass(frozen=True, slots=True)
class Advice:
    """One thing to be said, and what it rests on."""

    operator: str
    about: str
    verdict: str
    evidence: str


def suggest(tests: Sequence[OperatorTest]) -> Advice:
    """Return what one operator should practise next: the component that loses most points."""
    lost: dict[str, float] = {}
    for test in tests:
        for name, points in test.indicator.points.items():
            loss = test.indicator.largest[name] - points
            if not math.isnan(loss):
                lost[name] = lost.get(name, 0.0) + loss / len(tests)
    worst = max(lost, key=lambda name: lost[name])
    runs = f"{len(tests)} test{'s' if len(tests) > 1 else ''}"
    if lost[worst] <= 0.0:
        return Advice(tests[0].operator, "next", "nothing: all points", f"no loss in {runs}")
    ranked = sorted(lost, key=lambda name: -lost[name])[:3]
    evidence = ", ".join(f"{name} {lost[name]:.1f}" for name in ranked)
    verdict = f"practise {WORDS[worst]}"
    return Advice(
        tests[0].operator, "next", verdict, f"mean loss in points over {runs}: {evidence}"
    )


def familiarity(tests: Sequence[OperatorTest]) -> Advice:
    """Return whether an operator is at home in a scenario: times are steady, below the first."""
    times = [test.performance.duration_s for test in tests]
    about = f"environmental familiarity, {tests[0].scenario}"
    ratings = _first_and_last([test.performance.awareness for test in tests])
    if len(tests) < FEWEST:
        return Advice(tests[0].operator, about, "too few runs to say", f"{len(tests)} runs")
    last = np.array(times[-WINDOW:])
    spread = float(np.ptp(last) / last.mean())
    familiar = spread <= STEADY and last.mean() <= times[0]
    evidence = (
        f"last {WINDOW} times {', '.join(f'{t:.1f}' for t in last)} s spread {100 * spread:.0f} %, "
        f"the first was {times[0]:.1f} s; {ratings}"
    )
    return Advice(tests[0].operator, about, "familiar" if familiar else "still learning", evidence)


def fatigue(tests: Sequence[OperatorTest]) -> Advice:
    """Return whether a scenario is worn out: runs have become worse again after the best ones."""
    about = f"scenario fatigue, {tests[0].scenario}"
    percent = np.array([test.indicator.percent for test in tests])
    percent = percent[~np.isnan(percent)]
    if len(percent) < FEWEST:
        return Advice(tests[0].operator, about, "too few runs to say", f"{len(percent)} runs")
    means = np.convolve(percent, np.ones(WINDOW) / WINDOW, mode="valid")
    best, last = float(means.max()), float(means[-1])
    tired = best - last >= FALL
    verdict = "fatigue: give another scenario" if tired else "none"
    evidence = f"best mean of {WINDOW} runs {best:.1f} %, last {last:.1f} %; " + _first_and_last(
        [test.performance.awareness for test in tests]
    )
    return Advice(tests[0].operator, about, verdict, evidence)


def _first_and_last(ratings: Sequence[float]) -> str:
    given = [rating for rating in ratings if not math.isnan(rating)]
    if not given:
        return "no awareness was rated"
    return f"rated awareness went from {given[0]:.2f} to {given[-1]:.2f}"
