"""Groups of one, and people without a group: described by name, and in no test of groups."""

from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest
from scipy.stats import f_oneway

from labcrane.analysis.report.answer import _effects
from labcrane.analysis.report.factors import factors_of, with_factors
from labcrane.analysis.report.findings import Results, of_outcomes
from labcrane.analysis.report.outcomes import StudyMovements
from labcrane.analysis.report.words import depends
from labcrane.analysis.statistics.anova import Anova
from labcrane.analysis.statistics.mixed import mixed_model
from results.test_shortfalls import drawn, found, in_words

__all__ = ["found"]

Found = Callable[[pd.DataFrame], tuple[Results, str]]


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("last", "said"), [("c", "alone in group c"), ("", "in no group")])
def test_who_is_alone_in_a_group_is_in_no_test_and_named_with_why(
    found: Found, seed: int, last: str, said: str
) -> None:
    size = 1 if last else 1 + seed
    table = drawn(seed, (5, 6, size), sessions=1)
    table["group"] = table["group"].replace("c", last)
    gone = sorted(table.loc[table["group"] == last, "participant"].unique())
    results, _ = found(table)
    (row,) = results.table("anova")[results.table("anova")["factor"] == "group"].to_dict("records")
    means = table[table["group"] != last].groupby(["group", "participant"])["movement_time"].mean()
    theirs = f_oneway(means["a"], means["b"])
    assert (row["f"], row["p"]) == pytest.approx((theirs.statistic, theirs.pvalue))
    assert (row["n"], row["left_out"]) == (11, " ".join(gone))
    words = in_words(results)
    assert f": {said}." in words
    assert "F(1, 9) = " in words
    (answer,) = _effects(results)
    assert "n = 1:" not in answer


def test_two_groups_of_which_one_is_one_person_are_not_compared(found: Found) -> None:
    table = drawn(4, (11, 1), sessions=2)
    results, _ = found(table)
    assert not results.table("anova")["factor"].str.contains("group").any()
    assert not any(one.table == "contrasts" and one.effect == "group" for one in results.findings)
    assert set(results.table("anova")["left_out"]) == {"P012"}
    words = in_words(results)
    assert "Not tested over group" in words
    assert "in group a" in words
    assert "P012" in words


def test_the_mixed_model_is_of_people_who_are_not_alone_in_a_group() -> None:
    table = drawn(4, (11, 1), sessions=2).assign(phase=lambda own: own["session"].astype(str))
    model = mixed_model(table, "movement_time")
    assert (model.participants, model.alone) == (11, ("P012",))
    assert not model.terms["term"].str.contains("group").any()
    dice = np.random.default_rng(1)
    plain = table.assign(group="", y=dice.normal(size=len(table)))
    assert mixed_model(plain, "y").participants == 12


def test_a_planned_group_without_people_is_named_and_its_question_is_not_tested() -> None:
    """Nobody of it was recorded yet, or all of its movements failed."""
    there = "control"
    movements = drawn(3, (6,)).assign(group=there)
    whole = with_factors(movements)
    for factors in (
        factors_of(whole, planned_groups=(there, "sphere")),
        factors_of(whole, dict.fromkeys(movements["participant"], there) | {"Z1": "sphere"}),
    ):
        assert factors.groups == tuple(sorted((there, "sphere")))
        study = StudyMovements(whole, whole, factors, ("movement_time",))
        lacks = {one.effect: one.short[0].why for one in of_outcomes(study) if one.test is None}
        assert {"group", "group:session"} <= set(lacks)
        assert lacks["group"] == lacks["group:session"]
        assert lacks["group"].endswith(f"are in group {there}")


def test_by_chance_no_effect_depends_on_what_the_answer_does_not_show() -> None:
    """Of cohorts without effects some interaction of many is always found."""
    found = 0
    for seed in range(12):
        whole = with_factors(drawn(seed, (8, 8)))
        factors = factors_of(whole)
        study = StudyMovements(whole, whole, factors, ("movement_time",))
        findings = list(of_outcomes(study))
        tests = [one.test for one in findings if isinstance(one.test, Anova)]
        asked = {"group:session"}
        low = {test.factor for test in tests if ":" in test.factor and test.p_gg < 0.05}
        found += bool(low - asked)
        assert bool(depends(findings, factors)) == bool(low & asked)
    assert found, "such interactions were drawn"
