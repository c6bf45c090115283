"""The report's tables of tests, from movements alone."""

from collections.abc import Iterable, Sequence

import pandas as pd

from labcrane.analysis.report import outcomes
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

COUNTS = pd.DataFrame({"trials": [1], "time_outs": [0], "others": [0]})


def _table(name: str, findings: Iterable[StudyFinding], factors: Factors) -> pd.DataFrame:
    return Results("", COUNTS, factors, list(findings)).table(name)


def anova_table(
    results: pd.DataFrame, factors: Factors, primary: Sequence[str] = ()
) -> pd.DataFrame:
    return _table(
        "anova", of_outcomes(*[results.assign(outcome="success")] * 2, factors, primary), factors
    )


def trend_table(
    results: pd.DataFrame, factors: Factors, primary: Sequence[str] = ()
) -> pd.DataFrame:
    return _table(
        "trends", of_trends(*[results.assign(outcome="success")] * 2, factors, primary), factors
    )


def contrast_table(
    results: pd.DataFrame, factors: Factors, primary: Sequence[str] = ()
) -> pd.DataFrame:
    return _table("contrasts", of_contrasts(results, factors, primary), factors)


def gaze_tests(results: pd.DataFrame, factors: Factors) -> pd.DataFrame:
    return _table("gaze_tests", of_gaze_measures(results, results, factors), factors)


def score_tests(scores: pd.DataFrame, people: dict[str, str]) -> pd.DataFrame:
    factors = Factors((), (), "session", {}, practice=False, targets={}, crossed={}, people=people)
    return _table("score_tests", of_scores(scores, factors), factors)


def scales_in(results: Results) -> pd.DataFrame:
    """Return the quantities of the time scales over all groups."""
    return pd.DataFrame(one.test for one in results.findings if one.table == "time_scales")


def every_finding(
    results: pd.DataFrame, factors: Factors, primary: Sequence[str] = ()
) -> list[StudyFinding]:
    """Return the findings from movements that are all results."""
    of_scales, _ = outcomes.time_scale_tables(results, factors, primary)
    return [
        *of_outcomes(results, results, factors, primary),
        *of_contrasts(results, factors, primary),
        *of_trends(results, results, factors, primary),
        *of_time_scales(of_scales, results, factors),
    ]
