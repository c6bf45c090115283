"""Advice on what to practise next, and whether a scenario has been learned or worn out.

Rules of thumb with their evidence, not tests of significance; docs/indicator.md states them.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from labcrane.analysis.report.sample import counted
from labcrane.analysis.scoring.indicator import SUBJECTIVE
from labcrane.analysis.scoring.operator_tests import OperatorTest

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
"""Fewest runs of a scenario that are judged."""

STEADY = 0.1
"""Spread of the last three times, as a share of their mean, at which performance is stable."""

FALL = 5.0
"""Percentage points by which the last three runs are below the best three: fatigue."""

FELT = 0.1
"""Fall of a rating, 0 to 1, from which performance is not yet stable."""

WINDOW = 3

TOO_FEW = "too few runs to say"


@dataclass(frozen=True, slots=True)
class Advice:
    """One piece of advice, and its evidence."""

    operator: str
    about: str
    verdict: str
    evidence: str


def suggest(tests: Sequence[OperatorTest]) -> Advice:
    """Return the recommended practice of one operator: the component that loses most points."""
    lost: dict[str, float] = {}
    for test in tests:
        for name, points in test.indicator.points.items():
            loss = test.indicator.largest[name] - points
            if not math.isnan(loss):
                lost[name] = lost.get(name, 0.0) + loss / len(tests)
    worst = max(lost, key=lambda name: lost[name])
    runs = counted(len(tests), "test")
    if lost[worst] <= 0.0:
        return Advice(tests[0].operator, "next", "nothing: all points", f"no loss in {runs}")
    ranked = sorted(lost, key=lambda name: -lost[name])[:3]
    evidence = ", ".join(f"{name} {lost[name]:.1f}" for name in ranked)
    verdict = f"practise {WORDS[worst]}"
    return Advice(
        tests[0].operator, "next", verdict, f"mean loss in points over {runs}: {evidence}"
    )


def familiarity(tests: Sequence[OperatorTest]) -> Advice:
    """Return whether an operator's times are stable, below the first, and ratings not worse.

    Parameters
    ----------
    tests
        One operator's, in the order in which they were run. Of several scenarios, perhaps one of
        each, times are shares of each scenario's reference time.
    """
    across, where = _where(tests)
    about = f"environmental familiarity, {where}"
    if len(tests) < FEWEST:
        return Advice(tests[0].operator, about, TOO_FEW, counted(len(tests), "run"))
    unit = "of the reference" if across else "s"
    times = [test.performance.duration_s / (test.reference_s if across else 1.0) for test in tests]
    last = np.array(times[-WINDOW:])
    spread = float(np.ptp(last) / last.mean())
    steady = spread <= STEADY and last.mean() <= times[0]
    worse = [name for name, (before, now) in _felt(tests).items() if before - now > FELT]
    digits = 2 if across else 1
    evidence = (
        f"last {WINDOW} times {', '.join(f'{t:.{digits}f}' for t in last)} {unit} spread "
        f"{100 * spread:.0f} %, the first was {times[0]:.{digits}f} {unit}; {_ratings(tests)}"
    )
    verdict = "familiar" if steady and not worse else "still learning"
    if steady and worse:
        verdict = f"still learning: felt {' and '.join(worse)} has fallen"
    return Advice(tests[0].operator, about, verdict, evidence)


def fatigue(tests: Sequence[OperatorTest]) -> Advice:
    """Return whether there is scenario fatigue: runs became worse again after the best ones.

    They are compared by the indicator, which includes ratings, and times relative to the reference;
    ``tests`` are as for :func:`familiarity`.
    """
    across, where = _where(tests)
    about = f"scenario fatigue, {where}"
    percent = np.array([test.indicator.percent for test in tests])
    percent = percent[~np.isnan(percent)]
    if len(percent) < FEWEST:
        return Advice(tests[0].operator, about, TOO_FEW, counted(len(percent), "run"))
    means = np.convolve(percent, np.ones(WINDOW) / WINDOW, mode="valid")
    best, last = float(means.max()), float(means[-1])
    tired = best - last >= FALL
    other = "other scenarios, or a break" if across else "another scenario"
    verdict = f"fatigue: give {other}" if tired else "none"
    evidence = f"best mean of {WINDOW} runs {best:.1f} %, last {last:.1f} %; {_ratings(tests)}"
    return Advice(tests[0].operator, about, verdict, evidence)


def _where(tests: Sequence[OperatorTest]) -> tuple[bool, str]:
    """Return whether tests are of several scenarios, and which, in words."""
    across = len({test.scenario for test in tests}) > 1
    return across, "all scenarios" if across else tests[0].scenario


def _felt(tests: Sequence[OperatorTest]) -> dict[str, tuple[float, float]]:
    """Return the means of each rating's first and last few, where it was given often enough."""
    return {
        name: (float(np.mean(given[:WINDOW])), float(np.mean(given[-WINDOW:])))
        for name, given in _given(tests).items()
        if len(given) >= FEWEST
    }


def _given(tests: Sequence[OperatorTest]) -> dict[str, list[float]]:
    """Return the ratings that were given."""
    every = {name: [getattr(test.performance, name) for test in tests] for name in SUBJECTIVE}
    return {
        name: [rating for rating in own if not math.isnan(rating)] for name, own in every.items()
    }


def _ratings(tests: Sequence[OperatorTest]) -> str:
    return ", ".join(
        f"rated {name} went from {given[0]:.2f} to {given[-1]:.2f}"
        if given
        else f"no {name} was rated"
        for name, given in _given(tests).items()
    )
