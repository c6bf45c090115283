"""Drop-outs: every number of a report is of those who were tested, and says who is missing."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from labcrane.analysis.quality import is_result
from labcrane.analysis.report import figures, outcomes
from labcrane.analysis.report.answer import _effects, _untested
from labcrane.analysis.report.factors import factors_of, running, with_factors
from labcrane.analysis.report.findings import Results, of_outcomes
from labcrane.analysis.report.outcomes import StudyMovements
from results.consumers import needs_r, r, table
from results.test_shortfalls import drawn, found, given_up, in_words
from results.tested import COUNTS, score_tests

__all__ = ["found"]

Found = Callable[[pd.DataFrame], tuple[Results, str]]
TEST = re.compile(
    r"over (\w+) \(([^()]*); F\(([\d.]+), ([\d.]+)\) = ([\d.]+), p [<=] \.\d+, ηp² = [\d.]+"
    r"(?:, n = (\d+) of (\d+) people)?\)"
)


@pytest.fixture(params=range(3))
def dropped(request: pytest.FixtureRequest) -> tuple[pd.DataFrame, list[str]]:
    """Two groups, of whom some never came to the second session; and who did."""
    dice = np.random.default_rng([482, request.param])
    sizes = tuple(int(size) for size in dice.integers(4, 7, 2))
    movements = drawn(request.param, sizes)
    people = sorted(movements["participant"].unique())
    gone = dice.choice(people[1:-2], 2, replace=False)
    stays = [who for who in people if who not in gone]
    away = movements["participant"].isin(gone) & (movements["session"] == 2)
    return movements[~away], stays


def printed(text: str) -> dict[str, tuple[dict[str, float], list[float]]]:
    """Return the means, and df1, df2, F, n and sample, of each effect in the answer's words."""
    told = {}
    for name, levels, *numbers in TEST.findall(text):
        means = re.findall(r"(\S[^:;]*?): ([\d.]+) s", levels)
        about = {level.removeprefix(", "): float(mean) for level, mean in means}
        told[name] = (about, [float(one) for one in numbers if one])
    return told


def test_means_and_n_beside_a_test_are_of_those_who_were_tested(
    found: Found, dropped: tuple[pd.DataFrame, list[str]]
) -> None:
    movements, stays = dropped
    results, _ = found(movements)
    (said,) = _effects(results)
    told = printed(said)
    assert {"group", "session", "distance", "far_side"} <= set(told)
    people = movements["participant"].nunique()
    own = with_factors(movements[movements["participant"].isin(stays)])
    columns = {"group": "group", "session": "phase", "distance": "distance", "far_side": "far_side"}
    for name, column in columns.items():
        means, numbers = told[name]
        assert numbers[3:] == [len(stays), people], name
        by = list(dict.fromkeys(["participant", "group", "phase", column]))
        cells = own.groupby(by)["movement_time"].mean()
        each = cells.groupby(list(dict.fromkeys(["participant", "group", column]))).mean()
        in_groups = each.groupby(list(dict.fromkeys(["group", column]))).mean()
        wanted = in_groups.groupby(column).mean()  # F is of groups of equal weight
        assert len(means) == len(wanted)
        for (level, mean), value in zip(means.items(), wanted, strict=True):
            assert mean == pytest.approx(value, rel=6e-3), (name, level)
    assert "Not in every test, for the reasons given: " in _untested(results)[0]


AFEX = """
suppressMessages(library(afex))
d <- read.csv(commandArgs(TRUE)[1])
for (last in c("", "distance", "far_side")) {
  fit <- suppressMessages(suppressWarnings(aov_ez("participant", "movement_time", d,
    within = c("phase", if (nzchar(last)) last), between = "group", fun_aggregate = mean)))
  gg <- anova(fit, es = "pes", correction = "GG")
  for (effect in if (nzchar(last)) last else c("group", "phase"))
    say(effect, gg[effect, "num Df"], gg[effect, "den Df"], gg[effect, "F"],
        length(unique(fit$data$long$participant)),
        suppressMessages(as.data.frame(emmeans::emmeans(fit, effect))$emmean))
}
"""


@needs_r
@pytest.mark.slow
def test_what_is_printed_is_what_afex_says_of_the_same_rows(
    found: Found, dropped: tuple[pd.DataFrame, list[str]], tmp_path: Path
) -> None:
    movements, stays = dropped
    results, _ = found(movements)
    (said,) = _effects(results)
    told = printed(said)
    own = with_factors(movements)
    own.to_csv(tmp_path / "rows.csv", index=False)
    theirs = table(r(AFEX, tmp_path / "rows.csv"))
    assert set(theirs) == {"group", "phase", "distance", "far_side"}
    for effect, values in theirs.items():
        means, numbers = told["session" if effect == "phase" else effect]
        np.testing.assert_allclose(numbers[:3], np.array(values[:3], float), atol=0.0051)
        assert numbers[3] == float(values[3]) == len(stays)
        # R sorts distances as text.
        expected = sorted(map(float, values[4:]))
        np.testing.assert_allclose(sorted(means.values()), expected, rtol=6e-3)


@needs_r
@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_means_of_groups_of_unequal_size_and_unlike_changes_are_those_of_emmeans(
    found: Found, tmp_path: Path, seed: int
) -> None:
    """A few people get much faster and many a little slower: on average of groups, faster."""
    dice = np.random.default_rng([seed, 9])
    movements = drawn(seed, (int(dice.integers(8, 12)), 3))
    groups = sorted(movements["group"].unique())
    later = movements["session"] == 2
    for group, change in zip(groups, (1.12, 0.5), strict=True):
        movements.loc[later & (movements["group"] == group), "movement_time"] *= change
    results, _ = found(movements)
    (said,) = _effects(results)
    means, _ = printed(said)["session"]
    with_factors(movements).to_csv(tmp_path / "rows.csv", index=False)
    theirs = [float(value) for value in table(r(AFEX, tmp_path / "rows.csv"))["phase"][4:]]
    np.testing.assert_allclose(list(means.values()), theirs, rtol=6e-3)
    first, second = means.values()
    contrast = re.search(r"acquisition minus 2 retention: (\N{MINUS SIGN}?)", in_words(results))
    assert contrast is not None
    assert (first < second) == bool(contrast[1]), "the answer and the contrast agree"


def test_who_is_missing_is_named_with_why_and_in_every_table(
    found: Found, dropped: tuple[pd.DataFrame, list[str]]
) -> None:
    movements, stays = dropped
    results, page = found(movements)
    gone = sorted(set(movements["participant"]) - set(stays))
    names = " and ".join(gone)
    said = in_words(results)
    assert re.search(
        f"Without {names}, tested over session, group, sequence, .*: nothing recorded at session "
        "2 retention.",
        said,
    )
    scales = "slope of 2 retention, gain of 2 retention, change of 2 retention, "
    scales += "difference score of 2 retention, net gain of 2 retention"
    assert (
        f"Without {names}, tested over linear trend of sequence in 2 retention, {scales}: nothing "
        "recorded in 2 retention." in said
    )
    assert "Every planned test was made" not in page
    tables = (
        results.table("anova"),
        results.table("contrasts"),
        results.table("trends"),
        results.table("time_scales"),
    )
    people = movements["participant"].nunique()
    for each in tables:
        counted = each["left_out"].str.split().str.len()
        own = each[each["group"] == "all"] if "quantity" in each else each
        assert (own["n"] + counted[own.index] == people).all()
    assert set(results.table("contrasts")["left_out"]) == {" ".join(gone)}


def test_trends_contrasts_and_time_scales_are_of_the_rows_that_they_say(
    found: Found, dropped: tuple[pd.DataFrame, list[str]]
) -> None:
    movements, stays = dropped
    results, _ = found(movements)
    said = in_words(results)
    whole = with_factors(movements)
    people = whole["participant"].nunique()
    for phase, n in (("1 acquisition", people), ("2 retention", len(stays))):
        own = whole[whole["phase"] == phase]
        cells = own.groupby(["participant", "place"])["movement_time"].mean().unstack()
        slopes = [stats.linregress(cells.columns, row).slope for row in cells.to_numpy()]
        test = stats.ttest_1samp(slopes, 0.0)
        (sentence,) = re.findall(
            rf"Over the positions of {phase} it .*?people\.|"
            rf"Over the positions of {phase} it .*?\)\.",
            said,
        )[:1]
        assert f"t({n - 1}) = {test.statistic:.2f}".replace("-", "\N{MINUS SIGN}") in sentence
        assert (f", n = {n} of {people} people" in sentence) == (n < people)
    contrasts = results.table("contrasts")[results.table("contrasts")["factor"] == "session"]
    (row,) = contrasts[contrasts["at"] == ""].to_dict("records")
    cells = whole[whole["participant"].isin(stays)].groupby(["participant", "group", "phase"])
    wide = cells["movement_time"].mean().unstack().reset_index()
    wide["difference"] = wide["1 acquisition"] - wide["2 retention"]
    wanted = wide.groupby("group")["difference"].mean().mean()  # groups alike, as afex has them
    assert row["difference"] == pytest.approx(wanted, rel=1e-9)
    assert row["n"] == len(stays)
    scales = results.table("time_scales")[results.table("time_scales")["group"] == "all"].set_index(
        ["phase", "quantity"]
    )
    assert scales.loc[("1 acquisition", "slope"), "n"] == people
    assert set(scales.loc["2 retention", "n"]) == {len(stays)}


def test_the_means_of_a_figure_are_of_those_tested_and_its_lines_of_everybody(
    dropped: tuple[pd.DataFrame, list[str]],
) -> None:
    movements, stays = dropped
    whole = with_factors(movements)
    factors = factors_of(whole)
    results = whole[is_result(whole)]
    findings = list(of_outcomes(StudyMovements(results, results, factors)))
    tested = Results("", COUNTS, factors, findings).in_positions(results, "movement_time")
    assert sorted(tested["participant"].unique()) == stays
    shown = running(results, factors)
    drawing = figures.by_sequence(shown, "movement_time", running(tested, factors))
    own = shown[shown["participant"].isin(stays)]
    cells = own.groupby(["group", "sequence", "participant"])["movement_time"].mean()
    means = cells.groupby(["group", "sequence"]).mean()
    np.testing.assert_allclose(drawing.table.set_index(["group", "sequence"])["mean"], means)
    people = whole["participant"].nunique()
    assert f"of n = {len(stays)} participants" in drawing.caption
    assert "those who are tested" in drawing.caption
    assert f"thin lines: each of {people} participants" in drawing.caption
    assert "those who are tested" not in figures.by_sequence(own, "movement_time").caption


def test_a_time_out_is_told_from_a_session_that_somebody_never_came_to(found: Found) -> None:
    movements = drawn(7, (6,))
    out = (movements["participant"] == "P002") & (movements["session"] == 2)
    movements = given_up(movements, out & (movements["sequence"] == 3))
    away = (movements["participant"] == "P005") & (movements["session"] == 1)
    results, _ = found(movements[~away])
    said = in_words(results)
    assert (
        "Without P002 and P005, tested over sequence, sequence with pairs' means taken away: P002: "
        "no success at session 2 retention, sequence 3; P005: nothing recorded at session 1 "
        "acquisition." in said
    )
    assert "Without P005, tested over session, distance, far_side: nothing recorded at" in said


def test_who_succeeded_unseen_is_said_to_have_no_success_that_was_shown(found: Found) -> None:
    movements = drawn(1, (4, 5))
    unseen = (movements["participant"] == "P002") & (movements["session"] == 2)
    results, _ = found(movements.assign(presentation_failed=unseen.astype(float)))
    said = in_words(results)
    assert "no success that was shown at session 2 retention" in said
    assert "no success at" not in said


@pytest.mark.parametrize("seed", range(3))
def test_scores_tell_those_tested_beside_all_who_answered(seed: int) -> None:
    dice = np.random.default_rng([483, seed])
    people = {f"P{number:03}": "ab"[number % 2] for number in range(1, 10)}
    gone = set(dice.choice(list(people), 3, replace=False))
    rows = [
        {
            "participant": who,
            "questionnaire": "tlx",
            "score": "raw",
            "session": float(session),
            "step": 3.0,
            "value": float(dice.normal(50.0, 10.0)),
        }
        for who in people
        for session in (1, 2)
        if session == 1 or who not in gone
    ]
    scores = pd.DataFrame(rows)
    told = outcomes.score_table(scores, people).set_index(["group", "occasion"])
    for group in "ab":
        own = scores[scores["participant"].map(people) == group]
        for session in (1, 2):
            row = told.loc[(group, f"session {session}, step 3")]
            all_of_it = own.loc[own["session"] == session, "value"]
            here = (own["session"] == session) & ~own["participant"].isin(gone)
            whole = own.loc[here, "value"]
            assert (row["n"], row["n_tested"]) == (len(all_of_it), len(whole))
            np.testing.assert_allclose(row["mean"], all_of_it.mean())
            if len(whole):
                np.testing.assert_allclose(row["mean_tested"], whole.mean())
    for test in score_tests(scores, people).to_dict("records"):
        assert test["left_out"].split() == sorted(gone)
        assert test["n"] == 9 - len(gone)
