"""The crane study as it comes, simulated with its 36 people: the report has all of its results."""

import html
import itertools
import math
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from cranes import needs_mujoco
from needs import needs

from labcrane.analysis import find_cohort
from labcrane.analysis.quality import is_result
from labcrane.analysis.report.factors import with_factors
from labcrane.analysis.statistics.anova import Contrast, compare
from labcrane.testing import main
from results.consumers import needs_emmeans, needs_r, r, table

# Without the compiled kernels, half an hour.
pytestmark = [pytest.mark.long, pytest.mark.timeout(1800), needs("numba"), needs_mujoco]

STUDY = Path(__file__).parents[2] / "protocols" / "crane_pilot"
PEOPLE, POSITIONS, DISTANCES, MOVEMENTS = 36, 8, 4, 4
OUTCOMES = ("circle_to_circle", "movement_time", "onset_to_rest", "absolute_error")
"""The paper's time, the same from onset on to tap and to rest, and the paper's accuracy."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What the study left, simulated and reported by the commands that users type."""
    folder = tmp_path_factory.mktemp("crane")
    data, out = str(folder / "data"), str(folder / "report")
    assert main(["simulate", str(STUDY), "--participants", str(PEOPLE), "--out", data]) == 0
    assert main(["report", data, "--include", "simulated", "--out", out]) == 0
    return folder


def told(folder: Path, name: str) -> pd.DataFrame:
    return pd.read_csv(folder / "report" / "tables" / f"{name}.csv")


@pytest.fixture(scope="module")
def movements(folder: Path) -> pd.DataFrame:
    everything = with_factors(told(folder, "movements"))
    done = everything[is_result(everything)]
    done.to_csv(folder / "for_r.csv", index=False)
    return done


def test_every_movement_of_the_design_is_there(folder: Path) -> None:
    everything = told(folder, "movements")
    assert len(everything) == PEOPLE * POSITIONS * MOVEMENTS
    assert (everything["practice"] == 0).all()
    assert everything["group"].isna().all()  # nobody was in one


F_TEST = ("n", "f", "df1", "df2", "epsilon", "p_gg", "eta2p")
TREND = ("slope", "slope_low", "slope_high", "t", "df", "p", "p_holm")
SPLIT = ("measure", "distance", "sequence", "participants", "mean", "ci_low", "ci_high")
COURSE = ("sequence", "participants", "mean", "ci_low", "ci_high")

IN_THE_PAPER = {
    "36 people": ("sample", "", ("n",)),
    "20 male, 16 female": ("sample", "", ("gender",)),
    "18 to 35 years, M = 24.19, SD = 4.31": (
        "sample", "", ("age_min", "age_max", "age_mean", "age_sd"),
    ),
    "F(5.27, 184.33) = 2.43, p = .034, partial eta squared .07 for time": (
        "anova", "circle_to_circle", F_TEST,
    ),
    "F(3.53, 123.67) = 2.43, p = .034, partial eta squared .07 for accuracy": (
        "anova", "absolute_error", F_TEST,
    ),
    "time is significantly decreasing": ("trends", "circle_to_circle", TREND),
    "accuracy is significantly improving": ("trends", "absolute_error", TREND),
    "Figure 7 a": ("sequence_by_distance", "circle_to_circle", SPLIT),
    "Figure 7 b": ("sequence_by_distance", "absolute_error", SPLIT),
    "Figure 7 c": ("circle_to_circle_by_sequence", "", COURSE),
    "Figure 7 d": ("absolute_error_by_sequence", "", COURSE),
}  # fmt: skip
"""Every number and figure of the paper's results: the report's table, measure and columns."""


@pytest.mark.parametrize("words", IN_THE_PAPER)
def test_every_statistic_and_figure_of_the_paper_is_in_the_report_by_name(
    folder: Path, words: str
) -> None:
    name, measure, columns = IN_THE_PAPER[words]
    shown = told(folder, name)
    if measure:
        shown = shown[shown["measure"] == measure]
    if "factor" in shown:
        shown = shown[shown["factor"] == "sequence"]
    assert len(shown)
    for column in columns:
        assert shown[column].notna().all(), column
    if words.startswith("Figure"):
        for kind in ("svg", "png"):
            assert (folder / "report" / "figures" / f"{name}.{kind}").stat().st_size > 1000
        by = ["distance", "sequence"] if measure else ["sequence"]
        places = set(itertools.product(range(1, POSITIONS + 1)))
        if measure:
            places = set(itertools.product((2, 3, 4, 6), range(1, POSITIONS + 1)))
        assert set(shown[by].itertuples(index=False, name=None)) == places
        assert shown["participants"].sum() == (2 * DISTANCES if measure else POSITIONS) * PEOPLE
    # Whoever comes from the paper finds it by the paper's own words.
    rows = (STUDY.parents[1] / "docs" / "replication.md").read_text().splitlines()
    (row,) = [each for each in rows if f"| {words} |" in each]
    assert f"`{name}`" in row
    assert not measure or f"`{measure}`" in row


def in_words(folder: Path, kind: str, begin: str) -> str:
    """Return the paragraph of the results that begins so, in one of the three formats."""
    if kind == "html":
        page = (folder / "report" / "report.html").read_text()
        paragraphs = [html.unescape(each) for each in re.findall("<p>(.*?)</p>", page, re.S)]
    else:
        paragraphs = (folder / "report" / f"results.{kind}").read_text().split("\n\n")
    # The page's first part, its answer, begins with some of the same words.
    *_, found = [each for each in paragraphs if each.startswith(begin)]
    return found


SAMPLE = """
suppressMessages(library(hdf5r))
of <- function(path) {
  file <- H5File$new(path, "r"); on.exit(file$close_all())
  q <- file[["ses-01/questionnaires"]]
  item <- q[["item"]][]
  list(age = q[["value"]][][item == "age"], gender = q[["text"]][][item == "gender"])
}
all <- lapply(list.files(commandArgs(TRUE)[1], "[.]h5$", recursive = TRUE,
                         full.names = TRUE), of)
age <- unlist(lapply(all, `[[`, "age")); age <- age[is.finite(age)]
gender <- unlist(lapply(all, `[[`, "gender")); gender <- gender[gender != ""]
counts <- table(gender)
cat("n", length(all), sep = "|", fill = TRUE)
cat("gender", paste(counts, names(counts), collapse = ", "), sum(counts), sep = "|", fill = TRUE)
cat("age", sprintf("%g to %g years old, M = %.2f, SD = %.2f",
                   min(age), max(age), mean(age), sd(age)), length(age), sep = "|", fill = TRUE)
"""


@pytest.fixture(scope="module")
def sample_in_r(folder: Path) -> dict[str, list[str]]:
    return table(r(SAMPLE, folder / "data"))


@needs_r
@pytest.mark.parametrize("kind", ["html", "md", "tex"])
def test_age_and_gender_in_words_are_those_that_r_reads_from_the_recordings(
    folder: Path, sample_in_r: dict[str, list[str]], kind: str
) -> None:
    (n,), (gender, genders), (age, ages) = (sample_in_r[name] for name in ("n", "gender", "age"))
    assert n == str(PEOPLE)
    silent = f" and {PEOPLE - int(genders)} without an answer" if int(genders) < PEOPLE else ""
    known = f", of {ages} who said it" if int(ages) < PEOPLE else ""
    said = in_words(folder, kind, f"{PEOPLE} participants")
    assert f"{PEOPLE} participants ({gender}{silent}; {age}{known})." in said


@pytest.mark.parametrize("measure", OUTCOMES)
def test_each_outcome_has_its_trend_curves_and_model(folder: Path, measure: str) -> None:
    # The paper's two outcomes share a correction, and have curves and models of their own.
    primary = measure in {"circle_to_circle", "absolute_error"}
    trends = told(folder, "trends").set_index("measure")
    assert math.isfinite(trends.loc[measure, "p_holm"]) == primary
    assert len(told(folder, f"learning_{measure}"))
    assert "sequence" in set(told(folder, f"mixed_model_{measure}")["term"])


AFEX = """
suppressMessages(library(afex))
d <- read.csv(commandArgs(TRUE)[1])
for (dv in c("circle_to_circle", "movement_time", "onset_to_rest", "absolute_error")) {
  own <- d[!is.na(d[[dv]]), ] # some movements have no rest
  for (effect in c("sequence", "distance", "far_side", "distance:far_side")) {
    fit <- suppressMessages(suppressWarnings(aov_ez(
      "participant", dv, own, within = strsplit(effect, ":")[[1]], fun_aggregate = mean)))
    plain <- anova(fit, es = "pes", correction = "none")
    gg <- anova(fit, es = "pes", correction = "GG")
    say(paste(dv, effect), plain[effect, "F"], gg[effect, "num Df"], gg[effect, "den Df"],
        gg[effect, "Pr(>F)"], gg[effect, "pes"])
  }
}
"""


@needs_r
def test_the_numbers_are_those_of_afex_on_the_recordings(
    folder: Path, movements: pd.DataFrame
) -> None:
    theirs = table(r(AFEX, folder / "for_r.csv"))
    tests = told(folder, "anova").set_index(["measure", "factor"])
    assert len(theirs) == 16
    for key, values in theirs.items():
        measure, factor = key.split(" ")
        row = tests.loc[(measure, factor)]
        df = [row["epsilon"] * row["df1"], row["epsilon"] * row["df2"]]
        ours = [row["f"], *df, row["p_gg"], row["eta2p"]]
        np.testing.assert_allclose(ours, np.array(values, float), rtol=1e-6, err_msg=key)


WORDS = """
suppressMessages(library(afex))
d <- read.csv(commandArgs(TRUE)[1])
bare <- function(x, digits) sub("^0", "", sprintf(paste0("%.", digits, "f"), x))
p <- function(x) if (x < .001) "< .001" else paste("=", bare(x, 3))
for (dv in c("circle_to_circle", "movement_time", "onset_to_rest", "absolute_error")) {
  own <- d[!is.na(d[[dv]]), ]
  for (within in c("sequence", "distance")) {
    fit <- suppressMessages(suppressWarnings(
      aov_ez("participant", dv, own, within = within, fun_aggregate = mean)))
    gg <- anova(fit, es = "pes", correction = "GG")
    cat(paste(dv, within), sprintf("(%.2f, %.2f) = %.2f", gg[within, "num Df"],
        gg[within, "den Df"], gg[within, "F"]), p(gg[within, "Pr(>F)"]),
        paste("=", bare(gg[within, "pes"], 2)), sep = "|", fill = 1000)
  }
  m <- aggregate(own[[dv]], list(who = own$participant, at = own$sequence), mean)
  slopes <- sapply(split(m, m$who), function(own) coef(lm(x ~ at, own))[["at"]])
  s <- t.test(slopes)
  cat(paste(dv, "trend"), if (s$estimate < 0) "fell" else "rose",
      sprintf("%.3g", c(abs(s$estimate), s$conf.int)),
      sprintf("(%.0f) = %.2f", s$parameter, s$statistic), p(s$p.value), sep = "|", fill = 1000)
}
"""

SIGNS = {
    "html": ("F", "p", "t", "ηp²", "%", "<", "\N{MINUS SIGN}"),
    "md": ("*F*", "*p*", "*t*", "*η*<sub>p</sub>²", "%", "&lt;", "\N{MINUS SIGN}"),
    "tex": ("$F$", "$p$", "$t$", r"$\eta_p^2$", r"\%", "$<$", "$-$"),
}
BEGIN = {
    "circle_to_circle": "The time from circle to circle",
    "movement_time": "Movement time",
    "onset_to_rest": "The time from onset to rest",
    "absolute_error": "The distance from the target's centre",
}


@pytest.fixture(scope="module")
def words_in_r(folder: Path, movements: pd.DataFrame) -> dict[str, list[str]]:
    return table(r(WORDS, folder / "for_r.csv"))


@needs_r
@pytest.mark.parametrize("kind", SIGNS)
def test_f_p_and_partial_eta_squared_in_words_are_those_of_r(
    folder: Path, words_in_r: dict[str, list[str]], kind: str
) -> None:
    f, p, t, eta, percent, less, minus = SIGNS[kind]
    for measure, begin in BEGIN.items():
        said = in_words(folder, kind, begin)
        for factor in ("sequence", "distance"):
            ratio, chance, share = words_in_r[f"{measure} {factor}"]
            verb = (
                "differed"
                if chance.startswith("<") or float(chance[2:]) < 0.05
                else "did not detectably differ"
            )
            chance = chance.replace("<", less)
            assert f"{verb} over {factor}, {f}{ratio}, {p} {chance}, {eta} {share}" in said
        word, slope, low, high, value, chance = words_in_r[f"{measure} trend"]
        unit = "m" if measure == "absolute_error" else "s"
        trends = told(folder, "trends").set_index("measure")
        number = f"{word} by {slope}"
        if trends.loc[measure, "p_holm"] >= 0.05:
            number = f"did not detectably change: {minus * (word == 'fell')}{slope}"
        low, high, value = (each.replace("-", minus) for each in (low, high, value))
        assert (
            f"it {number} {unit} each, 95 {percent} CI [{low}, {high}], "
            f"{t}{value}, {p} {chance.replace('<', less)}"
        ) in said


EMMEANS = """
suppressMessages({library(afex); library(emmeans)})
d <- read.csv(commandArgs(TRUE)[1])
d$distance <- factor(d$distance)
for (dv in c("circle_to_circle", "movement_time", "onset_to_rest", "absolute_error")) {
  own <- d[!is.na(d[[dv]]), ]
  fit <- suppressMessages(suppressWarnings(
    aov_ez("participant", dv, own, within = "distance", fun_aggregate = mean)))
  means <- emmeans(fit, "distance", model = "multivariate")
  s <- summary(contrast(means, "pairwise", adjust = "holm"))
  say(dv, s$estimate, s$SE, s$df, s$t.ratio, s$p.value)
}
"""


@needs_emmeans
def test_the_contrasts_of_distances_are_those_of_emmeans(
    folder: Path, movements: pd.DataFrame
) -> None:
    theirs = table(r(EMMEANS, folder / "for_r.csv"))
    contrasts = told(folder, "contrasts")
    assert set(theirs) == set(OUTCOMES)
    for measure, values in theirs.items():
        own = contrasts[(contrasts["measure"] == measure) & (contrasts["factor"] == "distance")]
        assert len(own) == DISTANCES * (DISTANCES - 1) / 2
        ours = own[["difference", "se", "df", "t", "p_holm"]].to_numpy(float).T.ravel()
        np.testing.assert_allclose(ours, np.array(values, float), rtol=1e-6, err_msg=measure)


def planned(folder: Path, movements: pd.DataFrame) -> pd.Series:
    """Return the time in seconds that each person's own law gives the first stroke of a trial."""
    laws = {
        person.name: person.context["components"]["input"]["settings"]
        for person in find_cohort(folder / "data", ["simulated"]).included
    }

    def seconds(row) -> float:
        law = laws[row.participant]
        wear = math.exp(-law["learning_rate"] * (row.trial - 1))
        bits = math.log2(row.distance / 0.5 + 1.0)
        return (1.0 + law["learning_gain"] * wear) * (law["fitts_a_s"] + law["fitts_b_s"] * bits)

    return pd.Series([seconds(row) for row in movements.itertuples()], index=movements.index)


def test_the_learning_that_was_simulated_is_found(folder: Path, movements: pd.DataFrame) -> None:
    law = planned(folder, movements)
    trends = told(folder, "trends").set_index("measure")
    found = trends.loc["movement_time"]
    cells = law.groupby([movements["participant"], movements["sequence"]]).mean().unstack()
    slopes = np.polyfit(np.arange(1.0, POSITIONS + 1.0), cells.to_numpy().T, 1)[0]
    assert found["slope_low"] < slopes.mean() < found["slope_high"] < 0.0
    assert found["slope"] == pytest.approx(slopes.mean(), rel=0.15)
    assert (
        trends.loc["absolute_error", "slope_low"] < 0.0 < trends.loc["absolute_error", "slope_high"]
    )  # nobody was made to learn accuracy
    single = movements["sub_movements"] == 1
    ratio = (movements["movement_time"] / law)[single]
    assert len(ratio) > 300
    assert ratio.median() == pytest.approx(1.0, abs=0.03)
    means = law.groupby(movements["distance"]).mean()
    mine = movements.groupby("distance")["movement_time"].mean()
    assert list(means.rank()) == list(mine.rank()) == [1.0, 2.0, 3.0, 4.0]


def test_the_effect_of_distance_that_was_simulated_is_found_at_its_size(
    folder: Path, movements: pd.DataFrame
) -> None:
    # In one stroke: how many more an operator needs is chance, and grows with distance.
    one = movements[movements["sub_movements"] == 1]
    law = planned(folder, one)

    def contrasts(times: pd.Series) -> list[Contrast]:
        """Return what the report compares: every pair of distances."""
        return compare(one.assign(time=times), "time", "distance", ["distance"], [])

    wanted = np.array([each.difference for each in contrasts(law)])
    beside = contrasts(one["movement_time"] - law)
    found = np.array([each.difference for each in contrasts(one["movement_time"])])
    # The simulation's own scatter about the law, in what the contrasts leave of it.
    bound = 4.0 * np.array([each.se for each in beside])
    assert len(found) == DISTANCES * (DISTANCES - 1) / 2
    assert (np.abs(found - wanted) < bound).all()
    # An effect that is 20 % off, either way, is found out.
    for off in (0.8, 1.2):
        assert (np.abs(found - off * wanted) > bound).any()
    by_distance = (one["movement_time"] / law).groupby(one["distance"])
    np.testing.assert_allclose(by_distance.median(), 1.0, atol=0.05)
