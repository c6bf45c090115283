"""The studies of the usual designs: checked, planned, simulated, and tested by R as reported."""

import shutil
from collections import Counter
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from rehearsal import loaded

from labcrane.simulation.foreseen import foreseen_tests, in_words
from labcrane.testing import Study, main, plan_session
from results.consumers import needs_r, r
from results.undrawn import without_figures

DESIGNS = Path(__file__).parents[2] / "examples" / "designs"
NAMES = ("crossover", "pre_post", "washout")
PEOPLE = 12
ALONE = "with pairs' means taken away"
"""Of the report's tests, those that afex has not."""


def study_of(name: str) -> Study:
    return loaded(DESIGNS / name / "protocol.yaml")


def test_every_design_is_tried() -> None:
    assert tuple(sorted(path.name for path in DESIGNS.iterdir())) == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_a_check_asks_nothing_about_a_design(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", str(DESIGNS / name)]) == 0
    said = capsys.readouterr()
    assert f"study '{name}' is fine" in said.out
    assert "warning" not in said.out + said.err


@pytest.mark.parametrize("name", ["crossover", "washout"])
def test_of_every_two_participants_one_has_each_order_of_conditions(name: str) -> None:
    study = study_of(name)
    sessions = range(1, len(study.protocol.sessions) + 1)
    orders = []
    for person in range(1, PEOPLE + 1):
        plans = [plan_session(study, f"P{person:03}", number) for number in sessions]
        blocks = [block for plan in plans for block in plan.blocks if block.condition]
        orders.append(tuple(block.condition for block in blocks))
    one, other = study.protocol.design.conditions
    expected = {(one, other), (other, one)}
    assert all({*orders[at : at + 2]} == expected for at in range(0, PEOPLE, 2))


def test_groups_are_of_one_size_and_only_their_training_differs() -> None:
    study = study_of("pre_post")
    plans = [plan_session(study, f"P{person:03}", 1) for person in range(1, PEOPLE + 1)]
    assert Counter(plan.group for plan in plans) == {"control": 6, "sphere": 6}
    retention = [plan_session(study, plan.participant, 2) for plan in plans]
    assert [plan.group for plan in retention] == [plan.group for plan in plans]
    shown = {
        (plan.group, block.name, on)
        for plan in (*plans, *retention)
        for block in plan.blocks
        for on in block.feedback.values()
    }
    assert {each for each in shown if each[-1]} == {("sphere", "training", ("ball",))}
    assert len(shown) == 2 * 4


def once(name: str) -> object:
    """Return a design to be made once; that of most tests in the gate, the others by night."""
    marks = [pytest.mark.xdist_group(name), *([pytest.mark.long] if name != "crossover" else [])]
    return pytest.param(name, marks=marks)


@pytest.fixture(scope="module", params=map(once, NAMES))
def made(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A design's study, as somebody copies it, with recordings, report and tables beside it."""
    folder: Path = tmp_path_factory.mktemp("design") / request.param
    shutil.copytree(DESIGNS / request.param, folder)
    data, only = str(folder / "data"), ["--include", "simulated"]
    words = ["simulate", str(folder), "--participants", str(PEOPLE), "--out", data]
    assert main(words) == 0
    with without_figures():
        assert main(["report", data, *only, "--out", str(folder / "report")]) == 0
    words = ["export", data, *only, "--to", "tables", "--set", "streams=none"]
    assert main([*words, "--out", str(folder / "tables")]) == 0
    return folder


def reported(folder: Path, name: str) -> pd.DataFrame:
    return pd.read_csv(folder / "report" / "tables" / f"{name}.csv", keep_default_na=False)


@pytest.mark.slow
@needs_r
def test_r_finds_what_the_report_says_of_the_primary_outcome(
    made: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(made)
    r("source('analysis.R')")
    theirs = pd.read_csv(made / "analysis.csv").set_index(["measure", "factor"])
    tested = reported(made, "anova")
    ours = [tested[(tested["measure"] == "movement_time") & ~tested["factor"].str.endswith(ALONE)]]
    if made.name == "crossover":
        ours.append(reported(made, "score_tests"))
    every = pd.concat(ours).set_index(["measure", "factor"])
    assert sorted(every.index) == sorted(theirs.index)
    assert set(every["n"]) == {PEOPLE}
    columns = ["f", "df1", "df2", "p", "p_gg"]
    np.testing.assert_allclose(
        every.loc[theirs.index, columns].astype(float), theirs[columns], rtol=1e-6, atol=1e-12
    )


@pytest.mark.slow
def test_the_report_finds_what_was_put_into_the_cohort(made: Path) -> None:
    contrasts = reported(made, "contrasts")
    own = contrasts[contrasts["measure"] == "movement_time"].set_index(["factor", "at"])
    if made.name == "pre_post":
        gained = own.loc["group"]["difference"]
        assert own.loc[("group", "3 day 1, post-test"), "ci_low"] > 0.0
        assert gained["3 day 1, post-test"] == gained.max()
        tested = reported(made, "anova").set_index(["measure", "factor"])
        assert tested.loc[("movement_time", "group:phase"), "p_gg"] < 0.01
        return
    of_conditions = own.loc[("condition", "")]
    assert of_conditions["ci_low"] < 0.0 < of_conditions["ci_high"], "none was put in"
    if made.name == "crossover":
        assert own.loc[("block", ""), "ci_low"] > 0.0, "people learn from block to block"
    else:
        days = own.loc[("session", "")]
        assert days["ci_low"] < 0.0 < days["ci_high"], "everybody learns anew on each day"
    assert not any(reported(made, "anova")["confounded"])


@pytest.mark.slow
def test_a_rehearsal_names_the_tests_that_the_report_makes(
    made: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tested = reported(made, "anova")
    own = tested[tested["measure"] == "movement_time"].reset_index(drop=True)
    told = foreseen_tests(study_of(made.name)).reset_index(drop=True)
    pd.testing.assert_frame_equal(told, own[list(told)], check_dtype=False)
    assert main(["check", "--rehearse", str(made)]) == 0
    said = capsys.readouterr().out
    for factor in own["factor"][~own["factor"].str.endswith(ALONE)]:
        assert f" {factor};" in f"{said.rstrip()};"


def test_a_rehearsal_says_what_the_plan_cannot_tell_apart(tmp_path: Path) -> None:
    text = (DESIGNS / "crossover" / "protocol.yaml").read_text(encoding="utf-8")
    (tmp_path / "protocol.yaml").write_text(
        text.replace("condition: latin_square", "condition: as_written")
    )
    shutil.copy(DESIGNS / "crossover" / "instructions.md", tmp_path)
    tests = foreseen_tests(loaded(tmp_path / "protocol.yaml")).set_index("factor")
    said = tests["confounded"]
    assert (said["condition"], said["block"]) == (
        "the order in which conditions came",
        "conditions and feedback",
    )
    assert "condition (cannot be told from the order in which conditions came)" in in_words(
        tests.reset_index()
    )
