"""The crane study, simulated with its 36 people: all of the paper's results is in the report.

A physics engine and 240 Hz would make the same tables, only slowly; all else is the study's.
"""

import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from labcrane.analysis.cohort import find_cohort
from labcrane.analysis.quality import is_result
from labcrane.analysis.report import report
from labcrane.analysis.report.factors import with_factors
from labcrane.cli.app import main
from results.consumers import needs_emmeans, needs_r, r, table

pytestmark = [pytest.mark.long, pytest.mark.timeout(1800)]

STUDY = Path(__file__).parents[2] / "protocols" / "crane_pilot"
PEOPLE, POSITIONS, DISTANCES, MOVEMENTS = 36, 8, 4, 4
OUTCOMES = ("circle_to_circle", "movement_time", "absolute_error")
"""The paper's time, the same from onset on, and the paper's accuracy."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The study and what it left, simulated and reported by the commands that users type."""
    folder = tmp_path_factory.mktemp("crane")
    text = (STUDY / "protocol.yaml").read_text().replace("rate_hz: 240", "rate_hz: 20")
    text = text.replace("bullet_crane, actuator: ideal", "kinematic_crane")
    (folder / "protocol.yaml").write_text(text)
    for name in ("instructions.md", "cohort.yaml"):
        (folder / name).write_text((STUDY / name).read_text())
    data, out = str(folder / "data"), str(folder / "report")
    assert main(["simulate", str(folder), "--participants", str(PEOPLE), "--out", data]) == 0
    with pytest.MonkeyPatch.context() as patch:
        # The pages of single people, with five sixths of all figures, are tested elsewhere.
        patch.setattr(report, "_participant_page", lambda *_: None)
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


def test_the_sample_is_described_as_the_paper_describes_it(folder: Path) -> None:
    row = told(folder, "sample").iloc[0]
    assert row["n"] == PEOPLE
    assert {"age_mean", "age_sd", "age_min", "age_max", "gender"} <= set(row.index)
    assert f"{PEOPLE} participants" in (folder / "report" / "results.md").read_text()


@pytest.mark.parametrize(
    ("figure", "name", "measure"),
    [
        ("7a", "sequence_by_distance", "circle_to_circle"),
        ("7b", "sequence_by_distance", "absolute_error"),
        ("7c", "circle_to_circle_by_sequence", None),
        ("7d", "absolute_error_by_sequence", None),
    ],
)
def test_each_part_of_figure_7_is_there(folder: Path, figure: str, name: str, measure) -> None:
    for kind in ("svg", "png"):
        assert (folder / "report" / "figures" / f"{name}.{kind}").stat().st_size > 1000, figure
    shown = told(folder, name)
    if measure is None:
        assert list(shown["sequence"]) == list(range(1, POSITIONS + 1))
        assert (shown["participants"] == PEOPLE).all()
        return
    own = shown[shown["measure"] == measure]
    cells = {(row.distance, row.sequence) for row in own.itertuples()}
    assert cells == {(d, s) for d in (2, 3, 4, 6) for s in range(1, POSITIONS + 1)}
    assert own.groupby("distance")["participants"].sum().tolist() == [2 * PEOPLE] * DISTANCES


@pytest.mark.parametrize("measure", OUTCOMES)
def test_each_statistic_of_the_results_is_there_and_in_words(folder: Path, measure: str) -> None:
    tests = told(folder, "anova").set_index(["measure", "factor"])
    row = tests.loc[(measure, "sequence")]
    assert (row["n"], row["df1"], row["df2"]) == (PEOPLE, POSITIONS - 1, (POSITIONS - 1) * 35)
    assert 1.0 / (POSITIONS - 1) <= row["epsilon"] <= 1.0
    share = row["f"] * row["df1"] / (row["f"] * row["df1"] + row["df2"])
    assert row["eta2p"] == pytest.approx(share, rel=1e-9)
    df1, df2 = row["epsilon"] * row["df1"], row["epsilon"] * row["df2"]
    for name in ("results.md", "results.tex"):
        text = (folder / "report" / name).read_text()
        assert f"({df1:.2f}, {df2:.2f}) = {row['f']:.2f}" in text
    assert (measure, "distance") in tests.index
    trends = told(folder, "trends").set_index("measure")
    assert {"slope", "slope_low", "slope_high", "p"} <= set(trends.columns)
    assert measure in trends.index  # "significantly decreasing" has a direction


AFEX = """
suppressMessages(library(afex))
d <- read.csv(commandArgs(TRUE)[1])
say <- function(key, ...) cat(key, sprintf("%.17g", c(...)), sep = "|", fill = 10000)
for (dv in c("circle_to_circle", "movement_time", "absolute_error"))
  for (within in c("sequence", "distance", "far_side")) {
    fit <- suppressMessages(suppressWarnings(
      aov_ez("participant", dv, d, within = within, fun_aggregate = mean)))
    plain <- anova(fit, es = "pes", correction = "none")
    gg <- anova(fit, es = "pes", correction = "GG")
    say(paste(dv, within), plain[within, "F"], gg[within, "num Df"], gg[within, "den Df"],
        gg[within, "Pr(>F)"], gg[within, "pes"])
  }
"""


@needs_r
def test_the_numbers_are_those_of_afex_on_the_recordings(
    folder: Path, movements: pd.DataFrame
) -> None:
    theirs = table(r(AFEX, folder / "for_r.csv"))
    tests = told(folder, "anova").set_index(["measure", "factor"])
    assert len(theirs) == 9
    for key, values in theirs.items():
        measure, factor = key.split(" ")
        row = tests.loc[(measure, factor)]
        df = [row["epsilon"] * row["df1"], row["epsilon"] * row["df2"]]
        ours = [row["f"], *df, row["p_gg"], row["eta2p"]]
        np.testing.assert_allclose(ours, np.array(values, float), rtol=1e-6, err_msg=key)


EMMEANS = """
suppressMessages({library(afex); library(emmeans)})
d <- read.csv(commandArgs(TRUE)[1])
d$distance <- factor(d$distance)
say <- function(key, ...) cat(key, sprintf("%.17g", c(...)), sep = "|", fill = 10000)
for (dv in c("circle_to_circle", "movement_time", "absolute_error")) {
  fit <- suppressMessages(suppressWarnings(
    aov_ez("participant", dv, d, within = "distance", fun_aggregate = mean)))
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
