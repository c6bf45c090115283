"""Groups of one, and people without a group: described by name, and in no test of groups."""

from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest
from scipy.stats import f_oneway

from labcrane.analysis.report.answer import _effects
from labcrane.analysis.report.findings import Results
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
    (answer,) = _effects(table, results)
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
