"""The report's tables of tests, from movements alone."""

from collections.abc import Iterable, Sequence

import pandas as pd

from labcrane.analysis.report.factors import Factors
from labcrane.analysis.report.findings import (
    Results,
    StudyFinding,
    of_contrasts,
    of_gaze_measures,
    of_outcomes,
    of_scores,
    of_time_scales,
    of_trends,
)
from labcrane.analysis.report.outcomes import StudyMovements

COUNTS = pd.DataFrame({"trials": [1], "time_outs": [0], "others": [0]})


def _table(name: str, findings: Iterable[StudyFinding], factors: Factors) -> pd.DataFrame:
    return Results("", COUNTS, factors, list(findings)).table(name)


def all_results(
    movements: pd.DataFrame, factors: Factors, primary: Sequence[str] = ()
) -> StudyMovements:
    """Return movements that are all results."""
    whole = movements.assign(outcome="success")
    return StudyMovements(whole, whole, factors, primary)


def anova_table(
    results: pd.DataFrame, factors: Factors, primary: Sequence[str] = ()
) -> pd.DataFrame:
    return _table("anova", of_outcomes(all_results(results, factors, primary)), factors)


def trend_table(
    results: pd.DataFrame, factors: Factors, primary: Sequence[str] = ()
) -> pd.DataFrame:
    return _table("trends", of_trends(all_results(results, factors, primary)), factors)


def contrast_table(
    results: pd.DataFrame, factors: Factors, primary: Sequence[str] = ()
) -> pd.DataFrame:
    return _table("contrasts", of_contrasts(all_results(results, factors, primary)), factors)


def gaze_tests(results: pd.DataFrame, factors: Factors) -> pd.DataFrame:
    return _table("gaze_tests", of_gaze_measures(all_results(results, factors)), factors)


def score_tests(scores: pd.DataFrame, people: dict[str, str]) -> pd.DataFrame:
    factors = Factors((), (), "session", {}, practice=False, targets={}, crossed={}, people=people)
    return _table("score_tests", of_scores(scores, factors), factors)


def time_scales(results: pd.DataFrame, factors: Factors) -> pd.DataFrame:
    return _table("time_scales", of_time_scales(all_results(results, factors)), factors)


def every_finding(
    results: pd.DataFrame, factors: Factors, primary: Sequence[str] = ()
) -> list[StudyFinding]:
    """Return the findings from movements that are all results."""
    study = all_results(results, factors, primary)
    return [
        *of_outcomes(study),
        *of_contrasts(study),
        *of_trends(study),
        *of_time_scales(study),
    ]
