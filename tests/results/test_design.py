"""The report of a study with groups, two sessions and questionnaires, against R."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from simple_crane import CRANE

from labcrane.analysis import find_cohort
from labcrane.analysis.quality import is_result
from labcrane.analysis.report.factors import factors_of, with_factors
from labcrane.analysis.report.report import write_report
from labcrane.cli.app import main
from results.consumers import needs_r, r, table

pytestmark = [pytest.mark.long, pytest.mark.timeout(900)]

STUDY = (
    """\
labcrane: 1
study: design
title: Two groups, two sessions
participants: {pattern: 'P\\d{3}', planned: 7}
rate_hz: 60
"""
    + CRANE
    + """\
tasks:
  aiming: {use: aiming, distances: [2, 4], movements: 2, limit_s: 13}
questionnaires:
  person: {use: demographics, ask: [age, gender]}
design:
  groups: {none: [], slow: []}
  order: {pairs: shuffled}
sessions:
  - name: acquisition
    steps:
      - questionnaire: person
      - practice: {task: aiming, pairs: 1}
      - block: {task: aiming}
      - questionnaire: nasa_tlx
  - name: retention
    steps:
      - block: {task: aiming}
      - questionnaire: nasa_tlx
"""
)
COHORT = """\
labcrane_cohort: 1
operator:
  fitts_a_s: {median: 0.8, log_sd: 0.3}
  fitts_b_s: {median: 1.5, log_sd: 0.2}
groups:
  slow: {fitts_b_s: 1.3}
"""
PEOPLE = 7
"""Four in one group and three in the other."""


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Simulated as users do it; the report of what was recorded."""
    folder = tmp_path_factory.mktemp("design")
    (folder / "protocol.yaml").write_text(STUDY)
    (folder / "cohort.yaml").write_text(COHORT)
    data, out = folder / "data", folder / "report"
    asked = ["simulate", str(folder), "--participants", str(PEOPLE), "--out", str(data)]
    assert main(asked) == 0
    write_report(find_cohort(data, ["simulated"]), out)
    return out


def told(report: Path, name: str) -> pd.DataFrame:
    return pd.read_csv(report / "tables" / f"{name}.csv", keep_default_na=True)


@pytest.fixture(scope="module")
def movements(report: Path) -> pd.DataFrame:
    """What was recorded, with what the report says of each; also as R reads it."""
    everything = with_factors(told(report, "movements"))
    done = everything[is_result(everything)]
    done.to_csv(report / "for_r.csv", index=False)
    return done


def test_two_sessions_are_never_one_position(report: Path, movements: pd.DataFrame) -> None:
    factors = factors_of(with_factors(told(report, "movements")))
    assert factors.phases == ("1 acquisition", "2 retention")
    assert (factors.kind, factors.groups) == ("session", ("none", "slow"))
    assert factors.places == {"1 acquisition": 4, "2 retention": 4}
    shown = told(report, "movement_time_by_sequence")
    assert sorted(shown["sequence"].unique()) == list(range(1, 9))
    second = movements[(movements["phase"] == "2 retention") & (movements["group"] == "slow")]
    means = second[second["place"] == 1].groupby("participant")["movement_time"].mean()
    fifth = shown[(shown["sequence"] == 5) & (shown["group"] == "slow")]
    assert fifth["mean"].item() == pytest.approx(means.mean(), rel=1e-12)


def test_practice_is_a_factor_and_counts_for_no_average(
    report: Path, movements: pd.DataFrame
) -> None:
    tested = told(report, "practice").set_index(["measure", "factor"])
    everything = told(report, "movements")
    assert (everything["practice"] > 0).sum() == PEOPLE * 2
    assert (movements["practice"] == 0).all()
    row = tested.loc[("absolute_error", "practice")]
    assert row["n"] + len(str(row["left_out"]).replace("nan", "").split()) == PEOPLE
    assert ("absolute_error", "group:practice") in tested.index


CONTRASTS = """
d <- read.csv(commandArgs(TRUE)[1])
m <- aggregate(movement_time ~ participant + group + phase, d, mean)
w <- reshape(m, idvar = c("participant", "group"), timevar = "phase", direction = "wide")
w$group <- factor(w$group); contrasts(w$group) <- contr.sum(2)
a <- w[["movement_time.1 acquisition"]]; b <- w[["movement_time.2 retention"]]
s <- summary(lm(a - b ~ w$group))$coefficients[1, ]
say("session", s[c(1, 2, 3, 4)])
both <- cbind(c((a + b) / 2), a, b); p <- numeric(3)
for (i in 1:3) {
  s <- summary(lm(both[, i] ~ w$group))$coefficients[2, ]  # half of the first minus the second
  say(c("group", "group 1 acquisition", "group 2 retention")[i], 2 * s[1], 2 * s[2], s[3], s[4])
}
l <- aggregate(movement_time ~ participant + group + phase + distance, d, mean)
e <- aggregate(movement_time ~ participant + group + distance, l, mean)
"""


@needs_r
def test_contrasts_are_those_of_linear_models_of_each_difference(
    report: Path, movements: pd.DataFrame
) -> None:
    theirs = table(r(CONTRASTS, report / "for_r.csv"))
    own = told(report, "contrasts").fillna({"at": ""})
    own = own[(own["measure"] == "movement_time") & (own["factor"] != "distance")]
    found = {f"{row.factor} {row.at}".strip(): row for row in own.itertuples(index=False)}
    assert set(found) == set(theirs)
    for key, values in theirs.items():
        row = found[key]
        ours = [row.difference, row.se, row.t, row.p]
        np.testing.assert_allclose(ours, np.array(values, float), rtol=1e-6, err_msg=key)


def test_time_outs_are_counted_beside_the_mean_of_what_succeeded(report: Path) -> None:
    counts = told(report, "time_outs")
    everything = told(report, "movements")
    own = everything[everything["practice"] == 0]
    assert counts["trials"].sum() == len(own)
    assert counts["time_outs"].sum() == (own["outcome"] == "timeout").sum() > 0
    assert (counts["successes"] + counts["time_outs"] + counts["others"] == counts["trials"]).all()
    given_up = counts[counts["time_outs"] > 0]
    for row in given_up.itertuples(index=False):
        here = own[(own["group"] == row.group) & (own["distance"] == row.distance)]
        here = here[here["session_name"] == row.phase.partition(" ")[2]]
        done = here[here["outcome"] == "success"]
        assert row.mean_of_successes_s == pytest.approx(
            (done["movement_onset"] + done["movement_time"]).mean(), rel=1e-9
        )


def test_the_sample_is_that_of_the_answers(report: Path) -> None:
    about = told(report, "sample").set_index("group")
    assert about["n"].to_dict() == {"all": 7, "none": 4, "slow": 3}
    assert about.loc["all", "age_answers"] == about.loc[["none", "slow"], "age_answers"].sum()
    counts = [int(part.split()[0]) for part in about.loc["all", "gender"].split(", ")]
    assert sum(counts) <= PEOPLE
    page = (report / "report.html").read_text()
    assert "7 participants (" in page
    assert "<h1>SIMULATED: " in page, "whose results they are is the first that is read"


def test_questionnaires_are_outcomes_of_groups_and_sessions(report: Path) -> None:
    scores = told(report, "scores")
    assert set(scores["outcome"]) == {"nasa_tlx raw"}
    assert scores["n"].sum() <= 2 * PEOPLE
    tests = told(report, "score_tests")
    assert set(tests["factor"]) == {"group", "occasion", "group:occasion"}


def test_learning_has_two_time_scales(report: Path, movements: pd.DataFrame) -> None:
    scales = told(report, "time_scales")
    own = scales[(scales["measure"] == "movement_time") & (scales["group"] == "all")]
    found = {(row.phase, row.quantity): row for row in own.itertuples(index=False)}
    assert ("1 acquisition", "change") not in found
    assert {q for phase, q in found if phase == "2 retention"} == {
        "slope",
        "gain",
        "change",
        "difference score",
        "net gain",
    }
    decrement, gain = found[("2 retention", "difference score")], found[("2 retention", "gain")]
    kept = found[("2 retention", "net gain")]
    if decrement.n == gain.n == kept.n:
        assert decrement.mean + gain.mean == pytest.approx(kept.mean, rel=1e-9)
