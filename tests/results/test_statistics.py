"""Statistics against R, and against what was published."""

import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from labcrane.analysis.report import outcomes
from labcrane.analysis.report.factors import factors_of, with_factors
from labcrane.analysis.statistics.anova import analyse
from labcrane.analysis.statistics.reported import Reported, check_reported
from labcrane.analysis.statistics.time_outs import median_time
from labcrane.analysis.statistics.trends import holm, linear_trend, mixed_model
from results.consumers import needs_r, r, table
from results.synthetic import cohort_of_36

AFEX = """
suppressMessages({library(afex); library(lme4)})
d <- read.csv(commandArgs(TRUE)[1])
say <- function(key, ...) cat(key, sprintf("%.17g", c(...)), sep = "|", fill = 10000)
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
d$s <- d$sequence - mean(d$sequence); d$b <- d$difficulty - mean(d$difficulty)
mm <- lmer(log(movement_time) ~ s + b + far_side + (1 + s | participant), d, REML = TRUE,
           control = lmerControl(optCtrl = list(ftol_abs = 1e-12, xtol_abs = 1e-12)))
say("fixed", fixef(mm)); say("se", sqrt(diag(as.matrix(vcov(mm))))); say("sigma", sigma(mm))
"""


def anova_table(movements: pd.DataFrame) -> pd.DataFrame:
    table = with_factors(movements)
    return outcomes.anova_table(table, factors_of(table))


def trend_table(movements: pd.DataFrame) -> pd.DataFrame:
    table = with_factors(movements)
    return outcomes.trend_table(table, factors_of(table))


@pytest.fixture(scope="module")
def movements() -> pd.DataFrame:
    return cohort_of_36()


@pytest.fixture(scope="module")
def in_r(movements: pd.DataFrame, tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[str]]:
    path: Path = tmp_path_factory.mktemp("afex") / "movements.csv"
    movements.to_csv(path, index=False)
    return table(r(AFEX, path))


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


@needs_r
def test_trend_and_holm_are_those_of_r(movements: pd.DataFrame, in_r: dict[str, list[str]]) -> None:
    trend = linear_trend(movements, "movement_time")
    assert trend is not None
    ours = [trend.slope, trend.t, trend.df, trend.p, *trend.slope_ci]
    np.testing.assert_allclose(ours, np.array(in_r["trend"], float), rtol=1e-9)
    p = holm([0.01, 0.04, 0.03, 0.005])
    np.testing.assert_allclose(p, np.array(in_r["holm"], float), rtol=1e-12)


@needs_r
def test_the_mixed_model_is_that_of_lme4(
    movements: pd.DataFrame, in_r: dict[str, list[str]]
) -> None:
    model = mixed_model(movements, "movement_time")
    assert model is not None
    assert model.slopes
    assert model.converged
    named = ["Intercept", "sequence", "difficulty", "far_side[T.right]"]
    terms = model.terms.set_index("term").loc[named]
    np.testing.assert_allclose(terms["estimate"], np.array(in_r["fixed"], float), rtol=1e-3)
    np.testing.assert_allclose(terms["se"], np.array(in_r["se"], float), rtol=5e-3)
    assert model.residual_sd == pytest.approx(float(in_r["sigma"][0]), rel=1e-3)


def test_the_papers_movement_time_is_consistent_and_its_accuracy_is_not() -> None:
    time = check_reported(Reported("2.43", "5.27", "184.33", ".034", ".07"))
    assert time.p_consistent
    assert time.eta2p_consistent
    assert time.p == pytest.approx(0.0340, abs=5e-5)
    accuracy = check_reported(Reported("2.43", "3.53", "123.67", ".034", ".07"))
    assert not accuracy.p_consistent
    assert accuracy.p == pytest.approx(0.0586, abs=5e-5)
    assert (accuracy.p_low, accuracy.p_high) == pytest.approx((0.0582, 0.0590), abs=2e-4)


def epsilon(values: np.ndarray) -> float:
    """Return the epsilon of a table with participants as rows and levels as columns."""
    people, levels = np.indices(values.shape).reshape(2, -1)
    rows = {"participant": people, "level": levels, "value": values.ravel()}
    (effect,) = analyse(pd.DataFrame(rows), "value", within=["level"])
    return effect.epsilon


def test_epsilon_is_1_under_sphericity_and_least_for_one_varying_level() -> None:
    rng = np.random.default_rng(8)
    assert epsilon(rng.standard_normal((20_000, 4))) == pytest.approx(1.0, abs=2e-3)
    one_line = rng.standard_normal((50, 1)) * np.array([[0.0, 1.0, 2.0, 3.0]])
    assert epsilon(one_line) == pytest.approx(1.0 / 3.0)


def test_who_lacks_a_level_is_left_out_of_the_test_by_name(movements: pd.DataFrame) -> None:
    gone = (movements["participant"] == "P004") & (movements["sequence"] == 3)
    (test,) = analyse(movements[~gone], "movement_time", ["sequence"])
    assert (test.n, test.left_out) == (35, ("P004",))
    assert mixed_model(movements[~gone], "movement_time").participants == 36


def test_two_participants_are_not_tested(movements: pd.DataFrame) -> None:
    two = movements[movements["participant"] <= "P002"]
    assert analyse(two, "movement_time", ["sequence"]) == []
    assert linear_trend(two, "movement_time") is None
    assert mixed_model(two, "movement_time") is None
    assert anova_table(two).empty
    assert trend_table(two).empty


PRIMARIES = """
suppressMessages(library(lme4))
d <- read.csv(commandArgs(TRUE)[1])
say <- function(key, ...) cat(key, sprintf("%.17g", c(...)), sep = "|", fill = 10000)
dvs <- c("movement_time", "absolute_error", "circle_to_circle")
p <- sapply(dvs, function(dv) {
  m <- aggregate(d[[dv]], list(who = d$participant, at = d$sequence), mean)
  t.test(sapply(split(m, m$who), function(x) coef(lm(x ~ at, x))[2]))$p.value
})
say("paper", p.adjust(p[c("circle_to_circle", "absolute_error")], "holm"))
say("one", p.adjust(p["circle_to_circle"], "holm")); say("all", p.adjust(p, "holm"))
d$s <- d$sequence - mean(d$sequence); d$b <- d$difficulty - mean(d$difficulty)
mm <- lmer(log(circle_to_circle) ~ s + b + far_side + (1 + s | participant), d, REML = TRUE,
           control = lmerControl(optCtrl = list(ftol_abs = 1e-12, xtol_abs = 1e-12)))
say("fixed", fixef(mm)); say("se", sqrt(diag(as.matrix(vcov(mm)))))
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
    trends = outcomes.trend_table(whole, factors_of(whole), primary).set_index("measure")
    assert set(trends.index) == set(outcomes.USUAL)  # the others are tested, uncorrected
    asked = list(primary or outcomes.USUAL)
    theirs = np.array(primaries[name], float)
    np.testing.assert_allclose(trends.loc[asked, "p_holm"], theirs, rtol=1e-6)
    assert trends.drop(index=asked)["p_holm"].isna().all()


@needs_r
def test_the_mixed_model_of_the_time_from_circle_to_circle_is_that_of_lme4(
    with_dwell: pd.DataFrame, primaries: dict[str, list[str]]
) -> None:
    model = mixed_model(with_dwell, "circle_to_circle")
    assert model is not None
    named = ["Intercept", "sequence", "difficulty", "far_side[T.right]"]
    terms = model.terms.set_index("term").loc[named]
    np.testing.assert_allclose(terms["estimate"], np.array(primaries["fixed"], float), rtol=1e-3)
    np.testing.assert_allclose(terms["se"], np.array(primaries["se"], float), rtol=5e-3)


def test_an_outcome_of_another_kind_is_tested_where_the_study_calls_it_primary(
    with_dwell: pd.DataFrame,
) -> None:
    rows = with_dwell.assign(sparc=-with_dwell["movement_time"])
    whole = with_factors(rows)
    factors = factors_of(whole)
    for make in (outcomes.anova_table, outcomes.trend_table, outcomes.contrast_table):
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


def test_half_of_what_was_given_up_has_no_median_and_ten_per_cent_shifts_it() -> None:
    times = np.array([1.0, 2.0, 3.0, 4.0, 9.0, 9.0, 9.0, 9.0, 9.0])
    assert np.isnan(median_time(times, np.array([1.0] * 4 + [0.0] * 5)))
    assert median_time(np.arange(1.0, 6.0), np.array([1.0, 1.0, 1.0, 1.0, 0.0])) == 3.0
    assert np.isnan(median_time(np.ones(3), np.zeros(3)))
