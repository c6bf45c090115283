"""The report's tables of tests, from movements alone."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
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


def compare_with_afex(
    theirs: Mapping[str, Sequence[str]],
    results: pd.DataFrame,
    factors: Factors,
    names: Mapping[str, str],
    p: str = "p_holm",
) -> None:
    """Compare tests and contrasts of movement time with what R said of each effect.

    Parameters
    ----------
    theirs
        By ``anova EFFECT``: F, degrees of freedom without and with a correction, p, eta squared; by
        ``contrast FACTOR``: differences, errors, degrees of freedom, t and ``p``.
    names
        The report's names of columns.
    """
    tests = anova_table(results, factors).set_index(["measure", "factor"])
    contrasts = contrast_table(results, factors).set_index("measure")
    contrasts = contrasts[contrasts["at"].fillna("") == ""].loc["movement_time"]
    for key, values in theirs.items():
        kind, effect = key.split(" ")
        name = ":".join(names.get(part, part) for part in effect.split(":"))
        if kind == "anova":
            row = tests.loc[("movement_time", name)]
            corrected = [row["epsilon"] * row["df1"], row["epsilon"] * row["df2"]]
            ours = [row["f"], row["df1"], row["df2"], *corrected, row["p_gg"], row["eta2p"]]
        else:
            own = contrasts[contrasts["factor"] == name]
            ours = own[["difference", "se", "df", "t", p]].to_numpy(float).T.ravel().tolist()
        np.testing.assert_allclose(ours, np.array(values, float), rtol=1e-6, err_msg=key)


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
