"""Statistics against R, and against what was published."""

import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from labcrane.analysis.report import outcomes
from labcrane.analysis.report.factors import factors_of, with_factors
from labcrane.analysis.statistics.anova import analyse
from labcrane.analysis.statistics.mixed import NoModelError, mixed_model
from labcrane.analysis.statistics.time_outs import median_time
from labcrane.analysis.statistics.trends import holm, linear_trend
from results import tested
from results.consumers import needs_emmeans, needs_r, r, table
from results.synthetic import cohort_of_36
from results.test_shortfalls import drawn, given_up

AFEX = """
suppressMessages({library(afex); library(lme4)})
d <- read.csv(commandArgs(TRUE)[1])
for (dv in c("movement_time", "absolute_error")) for (factor in c("sequence", "distance")) {
  fit <- suppressMessages(suppressWarnings(
    aov_ez("participant", dv, d, within = factor, fun_aggregate = mean)))
  s <- suppressWarnings(summary(fit$Anova, multivariate = FALSE))
  u <- s$univariate.tests[factor, ]; a <- s$pval.adjustments[factor, ]
  eta <- anova(fit, es = "pes")[factor, "pes"]
  say(paste(dv, factor), u["F value"], u["num Df"], u["den Df"], u["Pr(>F)"],
      a["GG eps"], a["Pr(>F[GG])"], min(1, a["HF eps"]), eta)
}
m <- aggregate(movement_time ~ participant + sequence, d, mean)
slopes <- sapply(split(m, m$participant), function(x) coef(lm(movement_time ~ sequence, x))[2])
t <- t.test(slopes); say("trend", t$estimate, t$statistic, t$parameter, t$p.value, t$conf.int)
say("holm", p.adjust(c(0.01, 0.04, 0.03, 0.005), "holm"))
"""


def anova_table(movements: pd.DataFrame) -> pd.DataFrame:
    table = with_factors(movements)
    return tested.anova_table(table, factors_of(table))


def trend_table(movements: pd.DataFrame) -> pd.DataFrame:
    table = with_factors(movements)
    return tested.trend_table(table, factors_of(table))


@pytest.fixture(scope="module")
def movements() -> pd.DataFrame:
    return cohort_of_36()


@pytest.fixture(scope="module")
def in_r(movements: pd.DataFrame, tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[str]]:
    path: Path = tmp_path_factory.mktemp("afex") / "movements.csv"
    movements.to_csv(path, index=False)
    return table(r(AFEX, path))


@pytest.mark.slow
@needs_r
@pytest.mark.parametrize("measure", ["movement_time", "absolute_error"])
@pytest.mark.parametrize("factor", ["sequence", "distance"])
def test_the_reports_anova_is_that_of_afex(
    movements: pd.DataFrame, in_r: dict[str, list[str]], measure: str, factor: str
) -> None:
    rows = anova_table(movements).set_index(["measure", "factor"])
    ours = rows.loc[(measure, factor)]
    names = ["f", "df1", "df2", "p", "epsilon", "p_gg", "epsilon_hf", "eta2p"]
    theirs = np.array(in_r[f"{measure} {factor}"], float)
    np.testing.assert_allclose(ours[names].astype(float), theirs, rtol=1e-6, atol=1e-12)
    assert (ours["n"], ours["left_out"]) == (36, "")
    assert 0.3 < ours["epsilon"] < 1.0


@pytest.mark.slow
@needs_r
def test_trend_and_holm_are_those_of_r(movements: pd.DataFrame, in_r: dict[str, list[str]]) -> None:
    trend = linear_trend(movements, "movement_time")
    assert trend is not None
    ours = [trend.slope, trend.t, trend.df, trend.p, *trend.slope_ci]
    np.testing.assert_allclose(ours, np.array(in_r["trend"], float), rtol=1e-9)
    p = holm([0.01, 0.04, 0.03, 0.005])
    np.testing.assert_allclose(p, np.array(in_r["holm"], float), rtol=1e-12)


def epsilon(values: np.ndarray) -> float:
    """Return the epsilon of a table with participants as rows and levels as columns."""
    people, levels = np.indices(values.shape).reshape(2, -1)
    rows = {"participant": people, "level": levels, "value": values.ravel()}
    (effect,) = analyse(pd.DataFrame(rows), "value", within=["level"])
    return effect.epsilon


@pytest.mark.slow
def test_who_lacks_a_level_is_left_out_of_the_test_by_name(movements: pd.DataFrame) -> None:
    gone = (movements["participant"] == "P004") & (movements["sequence"] == 3)
    (test,) = analyse(movements[~gone], "movement_time", ["sequence"])
    assert (test.n, set(movements["participant"]) - set(test.people)) == (35, {"P004"})
    assert mixed_model(movements[~gone], "movement_time").participants == 36


@pytest.mark.slow
def test_two_participants_are_not_tested(movements: pd.DataFrame) -> None:
    two = movements[movements["participant"] <= "P002"]
    assert analyse(two, "movement_time", ["sequence"]) == []
    assert linear_trend(two, "movement_time") is None
    with pytest.raises(NoModelError, match="2 participants have a value, and 3 are needed"):
        mixed_model(two, "movement_time")
    assert anova_table(two).empty
    assert trend_table(two).empty


PRIMARIES = """
d <- read.csv(commandArgs(TRUE)[1])
dvs <- c("movement_time", "absolute_error", "circle_to_circle")
p <- sapply(dvs, function(dv) {
  m <- aggregate(d[[dv]], list(who = d$participant, at = d$sequence), mean)
  t.test(sapply(split(m, m$who), function(x) coef(lm(x ~ at, x))[2]))$p.value
})
say("paper", p.adjust(p[c("circle_to_circle", "absolute_error")], "holm"))
say("one", p.adjust(p["circle_to_circle"], "holm")); say("all", p.adjust(p, "holm"))
"""


@pytest.fixture(scope="module")
def with_dwell(movements: pd.DataFrame) -> pd.DataFrame:
    """The same, with reaction and dwell before each movement."""
    dice = np.random.default_rng(20)
    before = 0.3 * np.exp(dice.normal(0.0, 0.3, len(movements)))
    return movements.assign(circle_to_circle=movements["movement_time"] + before)


@pytest.fixture(scope="module")
def primaries(
    with_dwell: pd.DataFrame, tmp_path_factory: pytest.TempPathFactory
) -> dict[str, list[str]]:
    path: Path = tmp_path_factory.mktemp("primaries") / "movements.csv"
    with_dwell.to_csv(path, index=False)
    return table(r(PRIMARIES, path))


@pytest.mark.slow
@needs_r
@pytest.mark.parametrize(
    ("name", "primary"),
    [
        ("paper", ("circle_to_circle", "absolute_error")),
        ("one", ("circle_to_circle",)),
        ("all", ()),
    ],
)
def test_trends_are_corrected_over_the_outcomes_that_the_study_calls_primary(
    with_dwell: pd.DataFrame, primaries: dict[str, list[str]], name: str, primary: tuple[str, ...]
) -> None:
    whole = with_factors(with_dwell)
    trends = tested.trend_table(whole, factors_of(whole), primary).set_index("measure")
    assert set(trends.index) == set(outcomes.USUAL)  # the others are tested, uncorrected
    asked = list(primary or outcomes.USUAL)
    theirs = np.array(primaries[name], float)
    np.testing.assert_allclose(trends.loc[asked, "p_holm"], theirs, rtol=1e-6)
    assert trends.drop(index=asked)["p_holm"].isna().all()


@pytest.mark.slow
def test_an_outcome_of_another_kind_is_tested_where_the_study_calls_it_primary(
    with_dwell: pd.DataFrame,
) -> None:
    rows = with_dwell.assign(sparc=-with_dwell["movement_time"])
    whole = with_factors(rows)
    factors = factors_of(whole)
    for make in (tested.anova_table, tested.trend_table, tested.contrast_table):
        own = make(whole, factors, ("sparc",)).groupby("measure")
        mirrored, plain = own.get_group("sparc"), own.get_group("movement_time")
        np.testing.assert_allclose(mirrored["p"], plain["p"], rtol=1e-9)
        assert "sparc" not in set(make(whole, factors)["measure"])


def test_a_test_that_was_not_made_is_not_corrected_for() -> None:
    assert holm([0.02, math.nan]) == pytest.approx([0.02, math.nan], nan_ok=True)


MEDIANS = """
library(survival)
d <- read.csv(commandArgs(TRUE)[1])
m <- sapply(split(d, d$set), function(x)
  summary(survfit(Surv(seconds, finished) ~ 1, x))$table["median"])
for (i in seq_along(m)) cat(i - 1, sprintf("%.17g", m[i]), sep = "|", fill = 1000)
"""


@pytest.mark.slow
@needs_r
def test_medians_with_time_outs_are_those_of_survival(tmp_path: Path) -> None:
    rng = np.random.default_rng(41)
    tables = []
    for number in range(60):
        n = int(rng.integers(1, 12))
        seconds = np.round(rng.uniform(1.0, 6.0, n), 1)
        finished = (rng.uniform(size=n) < rng.uniform(0.3, 1.0)).astype(float)
        tables.append(pd.DataFrame({"set": number, "seconds": seconds, "finished": finished}))
    pd.concat(tables).to_csv(tmp_path / "times.csv", index=False)
    theirs = table(r(MEDIANS, tmp_path / "times.csv"))
    for number, own in enumerate(tables):
        ours = median_time(own["seconds"].to_numpy(), own["finished"].to_numpy())
        value = theirs[str(number)][0]
        expected = np.nan if value == "NA" else float(value)
        assert ours == pytest.approx(expected, nan_ok=True), own


DRAWN = """
suppressMessages({library(afex); library(emmeans)})
d <- read.csv(commandArgs(TRUE)[1])
d$distance <- factor(d$distance)
say <- function(...) cat(..., sep = "|", fill = 10000)
number <- function(...) sprintf("%.17g", c(...))
dv <- "movement_time"
for (within in list("phase", c("phase", "place"), c("phase", "distance"), c("phase", "far_side"),
                    c("distance", "far_side"))) {
  fit <- suppressMessages(suppressWarnings(aov_ez(
    "participant", dv, d, within = within, between = "group", fun_aggregate = mean)))
  plain <- anova(fit, es = "pes", correction = "none")
  gg <- anova(fit, es = "pes", correction = "GG")
  for (effect in rownames(plain)) {
    inside <- setdiff(strsplit(effect, ":")[[1]], "group")
    asked <- if ("far_side" %in% within & "distance" %in% within) length(inside) == 2 else
      length(within) == 1 | within[length(within)] %in% inside
    if (asked) say(paste("anova", effect), number(
      plain[effect, "F"], plain[effect, "num Df"], plain[effect, "den Df"], gg[effect, "num Df"],
      gg[effect, "den Df"], gg[effect, "Pr(>F)"], gg[effect, "pes"]))
  }
  compared <- c(if (length(within) == 1) c("phase", "group"),
                if (identical(within, c("phase", "distance"))) "distance")
  for (factor in compared) {
    s <- summary(contrast(suppressMessages(emmeans(fit, factor, model = "multivariate")),
                          "pairwise", adjust = "holm"))
    say(paste("contrast", factor), number(s$estimate, s$SE, s$df, s$t.ratio, s$p.value))
  }
}
"""


def drawn_study(seed: int) -> pd.DataFrame:
    """Return three groups of unequal size in two sessions, with time-outs and what nobody did.

    Somebody lacks all movements at one position, and somebody else a whole session.
    """
    dice = np.random.default_rng(seed)
    sizes = dice.choice(np.arange(6, 12), 3, replace=False)
    table = drawn(seed, tuple(sizes))
    one, other = dice.choice(table["participant"].unique(), 2, replace=False)
    gone = (table["participant"] == one) & (table["session"] == 2) & (table["sequence"] == 2)
    table = given_up(table, gone | (dice.random(len(table)) < 0.1))
    return table[~((table["participant"] == other) & (table["session"] == 2))]


@pytest.mark.slow
@needs_emmeans
def test_drawn_studies_of_unequal_groups_and_missing_cells_are_those_of_afex_and_emmeans(
    tmp_path: Path,
) -> None:
    seed = int(np.random.default_rng().integers(2**32))
    whole = with_factors(drawn_study(seed))
    factors = factors_of(whole)
    done = whole[whole["outcome"] == "success"]
    path = tmp_path / "movements.csv"
    done.to_csv(path, index=False)
    theirs = table(r(DRAWN, path))
    assert len(theirs) == 3 + 3 * 4 + 2 + 3
    print("seed", seed)  # noqa: T201 - shown where it fails
    tested.compare_with_afex(theirs, done, factors, {"phase": "session", "place": "sequence"})


def cells_of(seed: int, sessions: int, groups: tuple[str, ...] = ("none",)) -> pd.DataFrame:
    """Return one movement per pair and position, pairs in a drawn order for everybody."""
    dice = np.random.default_rng(seed)
    pairs = 5
    adds = dice.normal(0.0, 3.0, pairs)
    people = [group for group in groups for _ in range(int(dice.integers(4, 8)))]
    rows = [
        {
            "participant": f"P{person:03}",
            "group": group,
            "phase": f"{session} session",
            "place": place,
            "pair": f"pair {pair}",
            "movement_time": 9.0 + adds[pair] + person % 3 - 0.2 * place + dice.normal(0.0, 0.6),
        }
        for person, group in enumerate(people, start=1)
        for session in range(1, sessions + 1)
        for place, pair in enumerate(dice.permutation(pairs), start=1)
    ]
    return pd.DataFrame(rows)


@pytest.mark.parametrize("seed", range(6))
def test_positions_beside_pairs_are_tested_as_a_linear_model_of_both_tests_them(seed: int) -> None:
    """Few people: that what pairs add is estimated too costs freedom, and it is paid."""
    formula = pytest.importorskip("statsmodels.formula.api")
    cells = cells_of(seed, 1)
    (ours,) = analyse(cells, "movement_time", ["place"], beside="pair")
    both = formula.ols("movement_time ~ participant + pair + C(place)", cells).fit()
    f, p, df1 = both.compare_f_test(formula.ols("movement_time ~ participant + pair", cells).fit())
    found = [ours.f, ours.p, ours.df1, ours.df2]
    np.testing.assert_allclose(found, [f, p, df1, both.df_resid], rtol=1e-9)
    assert ours.df2 == (ours.n - 2) * 4.0
    assert 1.0 / 4.0 <= ours.epsilon <= 1.0


STRATA = """
d <- read.csv(commandArgs(TRUE)[1], stringsAsFactors = TRUE)
d$place <- factor(d$place)
model <- if (nlevels(d$group) > 1)
  movement_time ~ pair + group * phase * place + Error(participant / (phase * place)) else
  movement_time ~ pair + phase * place + Error(participant / (phase * place))
for (stratum in summary(aov(model, d))) {
  s <- stratum[[1]]; effects <- trimws(rownames(s))
  last <- tail(setdiff(effects, "Residuals"), 1)
  if (length(last) && grepl("place", last)) cat(last, sprintf("%.17g", c(
    s[effects == last, "F value"], s[effects == last, "Df"], s[effects == "Residuals", "Df"],
    s[effects == last, "Pr(>F)"])), sep = "|", fill = 1000)
}
"""

NOT_APART = 96
"""The seed of four people in whose orders a sum of pairs is a sum of positions, by chance."""


@pytest.mark.slow
@needs_r
@pytest.mark.parametrize(
    ("groups", "seed"),
    [(("none",), None), (("none", "slow", "fast"), None), (("none",), NOT_APART)],
)
def test_positions_beside_pairs_are_tested_in_the_strata_of_r(
    groups: tuple[str, ...], seed: int | None, tmp_path: Path
) -> None:
    """R tests what is left of an effect that pairs hide a part of; ours is of all of it or none."""
    seed = int(np.random.default_rng().integers(2**32)) if seed is None else seed
    cells = cells_of(seed, 2, groups)
    cells.to_csv(tmp_path / "cells.csv", index=False)
    theirs = table(r(STRATA, tmp_path / "cells.csv"))
    between = ["group"] if len(groups) > 1 else []
    tests = analyse(cells, "movement_time", ["phase", "place"], between, "pair")
    ours = {test.factor: test for test in tests}
    before = "group:" if between else ""
    # In each stratum the last: R's terms come one after the other, and only the last beside all.
    assert set(theirs) == {f"{before}place", f"{before}phase:place"}
    whole = max(1, len(groups) - 1) * (cells["place"].nunique() - 1)
    for name, values in theirs.items():
        said = f"{name}, seed {seed}"
        assert (name in ours) == (float(values[1]) == whole), said
        if name in ours:
            found = [getattr(ours[name], what) for what in ("f", "df1", "df2", "p")]
            np.testing.assert_allclose(found, np.array(values, float), rtol=1e-6, err_msg=said)


def test_positions_that_cannot_be_told_from_pairs_are_not_tested_beside_them() -> None:
    cells = cells_of(1, 1)
    same = cells.assign(pair="pair " + cells["place"].astype(str))
    assert analyse(same, "movement_time", ["place"], beside="pair") == []
    (plain,) = analyse(same, "movement_time", ["place"])
    (one,) = analyse(same.assign(pair="pair 1"), "movement_time", ["place"], beside="pair")
    assert one == plain
