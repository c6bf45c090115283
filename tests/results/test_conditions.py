"""A crossover of two conditions in the report: the effect put in, against SciPy and statsmodels."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from rehearsal import SHORT
from scipy.stats import ttest_ind

from labcrane.analysis.report import outcomes
from labcrane.analysis.report.answer import _effects
from labcrane.analysis.report.factors import factors_of, with_factors
from labcrane.analysis.report.findings import Results, of_scores
from labcrane.analysis.report.words import STYLES, paragraphs
from labcrane.simulation.power import Claim, read_effect
from labcrane.simulation.reported import ask, plan_test
from labcrane.testing import main
from results import tested
from results.consumers import needs_emmeans, r, table
from results.undrawn import without_figures

EFFECT = 0.6


def crossover(
    seed: int, people: int, names: tuple[str, ...], *, balanced: bool = True
) -> pd.DataFrame:
    """Return movements of people who learn a lot; the last condition takes ``EFFECT`` longer."""
    dice = np.random.default_rng(seed)
    rows = []
    for person in range(people):
        pace, own = dice.normal(3.0, 0.6), dice.normal(0.0, 0.1)
        turn = person % len(names) if balanced else 0
        order = names[turn:] + names[:turn]
        for block, name in enumerate(order, start=1):
            for pair, (distance, side) in enumerate(
                (d, s) for d in (2.0, 4.0) for s in ("left", "right")
            ):
                for _ in range(2):
                    time = pace - 0.7 * block + 0.2 * distance + dice.normal(0.0, 0.2)
                    time += (EFFECT + own) * (name == names[-1])
                    rows.append(
                        {"participant": f"P{person:03}", "session": 1, "session_name": "only",
                         "block": block, "block_name": f"b{block}", "condition": name,
                         "sequence": 4 * (block - 1) + pair + 1, "trial": len(rows) + 1,
                         "distance": distance, "far_side": side, "difficulty": distance / 0.5,
                         "movement_time": time + 3.0, "practice": 0, "outcome": "success"}
                    )  # fmt: skip
    return with_factors(pd.DataFrame(rows))


def of_condition(table: pd.DataFrame, movements: pd.DataFrame) -> pd.Series:
    rows = table(movements, factors_of(movements))
    (found,) = [row for _, row in rows.iterrows() if row["factor"] == "condition"]
    return found


def of_orders(values: pd.DataFrame, value: str, place: str) -> Any:
    """Return the t test between orders of half of second minus first (Jones & Kenward)."""
    each = values.groupby(["participant", "condition"]).agg({value: "mean", place: "min"})
    wide = each[value].unstack().dropna()
    first = each[place].unstack().loc[wide.index].idxmin(axis=1)
    plain = first == "plain"
    change = (wide["tone"] - wide["plain"]) * np.where(plain, 0.5, -0.5)
    return ttest_ind(-change[plain], -change[~plain])


@pytest.mark.parametrize("left", [16, 13, 11])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_two_conditions_are_compared_between_orders_and_the_effect_is_found(
    seed: int, left: int
) -> None:
    """Half of each person's change, of those who began with one against those with the other."""
    movements = crossover(seed, 16, ("plain", "tone"))
    gone = [f"P{person:03}" for person in range(0, 2 * (16 - left), 2)]  # all of one order
    movements = movements[~movements["participant"].isin(gone)]
    theirs = of_orders(movements, "movement_time", "block")
    anova = of_condition(tested.anova_table, movements)
    assert anova["f"] == pytest.approx(theirs.statistic**2)
    assert (anova["df1"], anova["df2"], anova["n"]) == (1, left - 2, left)
    assert anova["p"] == pytest.approx(theirs.pvalue)
    assert not anova["confounded"]
    contrast = of_condition(tested.contrast_table, movements)
    low, high = theirs.confidence_interval(0.95)
    assert contrast["difference"] == pytest.approx((low + high) / 2.0)
    assert (contrast["ci_low"], contrast["ci_high"]) == pytest.approx((low, high))
    assert abs(contrast["difference"] + EFFECT) < 3.0 * contrast["se"]
    learned = movements.assign(movement_time=movements["movement_time"] - 5.0 * movements["block"])
    again = of_condition(tested.anova_table, learned)
    assert again["f"] == pytest.approx(anova["f"]), "what changes by block changes no test"


def test_means_beside_the_test_of_conditions_are_without_the_period() -> None:
    movements = crossover(2, 16, ("plain", "tone"))
    movements = movements[movements["participant"].isin([f"P{n:03}" for n in (*range(12), 12, 14)])]
    factors = factors_of(movements)
    results = Results("", tested.COUNTS, factors, tested.every_finding(movements, factors))
    (said,) = (text for text in _effects(results) if text.startswith("Movement time"))
    found = re.search(r"over condition \(plain: ([\d.]+), tone: ([\d.]+); F\(1, 12\)", said)
    assert found
    plain, tone = map(float, found.groups())
    difference = of_condition(tested.contrast_table, movements)["difference"]
    assert plain - tone == pytest.approx(difference, abs=0.011)
    means = movements.groupby(["condition", "participant"])["movement_time"].mean()
    raw = means.groupby(level=0).mean()
    assert abs(raw["plain"] - raw["tone"] - difference) > 0.05, "the orders are not even"
    words = " ".join(paragraphs(results, STYLES["html"]))
    assert re.search(
        r"over condition, F\(1, 12\) = [\d.]+, p [=<] [\d.]+, ηp² = .\d+, period", words
    )
    assert re.search(
        r"plain minus tone: .*?Holm-corrected p [=<] [\d.]+, period taken out\.", words
    )


OF_PERIODS = """
suppressMessages(library(afex))
d <- read.csv(commandArgs(TRUE)[1])
for (cohort in unique(d$cohort)) {
  own <- d[d$cohort == cohort, ]
  own$period <- factor(own$period)
  found <- drop1(lm(y ~ participant + period + condition, own), ~ ., test = "F")
  rest <- df.residual(lm(y ~ participant + period + condition, own))
  say(cohort, found["condition", "F value"], found["condition", "Df"], rest,
    found["condition", "Pr(>F)"])
  if (length(unique(own$condition)) == 2) {
    own$order <- ave(own$condition, own$participant, FUN = function(x) x[1])
    mixed <- suppressMessages(aov_ez("participant", "y", own, within = "condition",
      between = "order"))$anova_table["condition", ]
    say(paste(cohort, "orders"), mixed$F, mixed$`num Df`, mixed$`den Df`, mixed$`Pr(>F)`)
  }
}
"""


@pytest.mark.slow
@needs_emmeans
def test_conditions_are_tested_as_r_does_with_the_period(tmp_path: Path) -> None:
    dice = np.random.default_rng(31)
    ours, parts = {}, []
    for at in range(24):
        names = ("a", "b", "c")[: 2 + at % 2]
        people = int(dice.integers(5 + 3 * (at % 2), 20))
        movements = crossover(100 + at, people, names)
        gone = [f"P{n:03}" for n in dice.choice(people, people // 6, replace=False)]
        last = movements["block"] == len(names)  # they left before the end
        movements = movements[~(movements["participant"].isin(gone) & last)]
        row = of_condition(tested.anova_table, movements)
        ours[f"c{at}"] = row[["f", "df1", "df2", "p"]].to_numpy(float)
        whole = movements[~movements["participant"].isin(gone)]
        means = whole.groupby(["participant", "block", "condition"])["movement_time"].mean()
        cells = means.rename("y").reset_index().rename(columns={"block": "period"})
        parts.append(cells.assign(cohort=f"c{at}"))
    path = tmp_path / "cells.csv"
    pd.concat(parts).to_csv(path, index=False)
    theirs = table(r(OF_PERIODS, path))
    assert len(theirs) == 24 + 12
    for name, found in theirs.items():
        expected = np.array(found, float)
        np.testing.assert_allclose(ours[name.split()[0]], expected, rtol=1e-6, err_msg=name)


def test_what_is_lost_of_four_blocks_costs_no_degrees_of_freedom() -> None:
    """ABBA and BAAB: the mean of a condition is of two blocks, also where movements are lost."""
    two = [crossover(7, 12, ("plain", "tone")).assign(half=half) for half in (0, 1)]
    both = pd.concat(two, ignore_index=True)
    both["block"] = both["block"].where(both["half"] == 0, 5 - both["block"])
    both["block_name"] = "b" + both["block"].astype(str)
    both = with_factors(both[["participant", "session", "session_name", "block", "block_name",
        "condition", "sequence", "trial", "distance", "far_side", "difficulty", "movement_time",
        "practice", "outcome"]].sort_values(["participant", "block", "sequence"]))  # fmt: skip
    few = both.drop(index=np.random.default_rng(2).choice(both.index, 20, replace=False))
    assert of_condition(tested.anova_table, both)["df2"] == 10
    assert of_condition(tested.anova_table, few)["df2"] == 10


def test_who_lacks_a_condition_is_left_out_by_name() -> None:
    movements = crossover(2, 10, ("plain", "tone"))
    gone = (movements["participant"] == "P003") & (movements["condition"] == "tone")
    ours = of_condition(tested.anova_table, movements[~gone])
    assert (ours["n"], ours["left_out"]) == (9, "P003")


def test_conditions_in_one_order_for_everybody_cannot_be_told_from_it() -> None:
    alike = crossover(2, 10, ("plain", "tone"), balanced=False)
    said = "the order in which conditions came"
    assert of_condition(tested.anova_table, alike)["confounded"] == said
    assert of_condition(tested.contrast_table, alike)["confounded"] == said


def test_three_conditions_of_people_who_all_had_one_order_are_confounded_whoever_else_began() -> (
    None
):
    movements = crossover(4, 9, ("a", "b", "c"))
    turned = movements["participant"].str[1:].astype(int) % 3 > 0
    movements = movements[~(turned & (movements["block"] == 3))]  # they did not come to the end
    said = "the order in which conditions came"
    row = of_condition(tested.anova_table, movements)
    assert (row["n"], row["confounded"]) == (3, said)
    contrasts = tested.contrast_table(movements, factors_of(movements))
    own = contrasts[contrasts["factor"] == "condition"]
    assert set(own["confounded"]) == {said}


def test_what_comes_with_each_block_in_everybody_is_named_beside_its_change() -> None:
    alike = crossover(2, 10, ("plain", "tone"), balanced=False)
    factors = factors_of(alike)
    of_blocks = tested.anova_table(alike, factors).set_index("factor")
    assert of_blocks.loc["block", "confounded"] == "conditions"
    contrasts = tested.contrast_table(alike, factors).set_index("factor")
    assert contrasts.loc["block", "confounded"] == "conditions"
    scales = tested.time_scales(alike, factors)
    change = scales[(scales["quantity"] == "change") & (scales["measure"] == "movement_time")]
    assert set(change["confounded"]) == {"conditions"}
    slope = scales[scales["quantity"] == "slope"]
    assert set(slope["confounded"]) == {""}
    even = crossover(2, 10, ("plain", "tone"))
    rows = tested.anova_table(even, factors_of(even)).set_index("factor")
    assert rows.loc["block", "confounded"] == ""
    wide = crossover(5, 8, ("plain",))
    longer = wide["movement_time"] + np.random.default_rng(5).normal(1.0, 0.2, len(wide))
    narrow = wide.assign(block=2, block_name="narrow", width=0.3, feedback="ball", distance=3.0)
    narrow = narrow.assign(movement_time=longer)
    both = pd.concat([wide.assign(width=0.8, feedback="none"), narrow], ignore_index=True)
    both = with_factors(both.drop(columns=["condition", "phase", "place"]))
    rows = tested.anova_table(both, factors_of(both)).set_index("factor")
    said = "feedback and the targets' distance and the targets' width"
    assert rows.loc["block", "confounded"] == said


def asked_after(movements: pd.DataFrame, seed: int) -> pd.DataFrame:
    """Return a load of 10 more under ``tone``, asked after each block and once more at the end."""
    dice = np.random.default_rng(seed)
    blocks = movements.drop_duplicates(["participant", "block"])
    rows = [
        {"participant": row["participant"], "session": 1, "block": row["block"],
         "step": 2.0 * row["block"], "questionnaire": "tlx", "score": "raw",
         "value": dice.normal(40.0, 5.0) + 10.0 * (row["condition"] == "tone")}
        for row in blocks.to_dict("records")
    ]  # fmt: skip
    last = [{**row, "step": 5.0, "value": 0.0} for row in rows if row["block"] == 2]
    return pd.DataFrame([*rows, *last])


def test_a_score_is_tested_over_conditions_with_the_occasion_taken_out() -> None:
    movements = crossover(3, 13, ("plain", "tone"))
    people = dict.fromkeys(sorted(set(movements["participant"])), "")
    scores = outcomes.with_conditions(asked_after(movements, 4), movements)
    scores = scores[(scores["participant"] != "P003") | (scores["condition"] == "plain")]
    tests = tested.score_tests(scores, people).set_index("factor")
    first = scores[scores["step"] < 5.0]
    means = first.pivot_table(values="value", index="participant", columns="condition").dropna()
    theirs = of_orders(first.rename(columns={"value": "raw"}), "raw", "step")
    row = tests.loc["condition"]
    assert (row["f"], row["p"]) == pytest.approx((theirs.statistic**2, theirs.pvalue))
    assert (row["n"], row["left_out"], row["confounded"]) == (12, "P003", "")
    table = outcomes.score_table(scores, people, "condition").set_index("condition")
    assert table["n"].to_dict() == {"plain": 13, "tone": 12}
    assert set(table["n_tested"]) == {12}
    np.testing.assert_allclose(table["mean_tested"], means.mean())
    alike = crossover(3, 13, ("plain", "tone"), balanced=False)
    scores = outcomes.with_conditions(asked_after(alike, 4), alike)
    tests = tested.score_tests(scores, people).set_index("factor")["confounded"]
    said = "the order in which conditions came"
    assert (tests["condition"], tests["occasion"]) == (said, "conditions")


def test_who_is_alone_in_a_group_is_named_beside_the_test_of_scores_over_conditions() -> None:
    movements = crossover(3, 13, ("plain", "tone"))
    names = sorted(set(movements["participant"]))
    people = dict(zip(names, [*"ab" * 6, "c"], strict=True))
    scores = outcomes.with_conditions(asked_after(movements, 4), movements)
    factors = factors_of(movements, people)
    (finding,) = (one for one in of_scores(scores, factors) if one.columns == ("condition",))
    assert (finding.test.n, set(people) - set(finding.test.people)) == (12, {names[-1]})
    assert [(one.without, one.whole, one.why) for one in finding.short] == [
        (names[-1], 12, "alone in group c")
    ]


def test_a_score_that_was_asked_once_at_the_end_is_not_tested_over_conditions() -> None:
    movements = crossover(3, 12, ("plain", "tone"))
    people = dict.fromkeys(sorted(set(movements["participant"])), "")
    scores = outcomes.with_conditions(asked_after(movements, 4), movements)
    scores = scores[scores["step"] == 5.0]
    assert tested.score_tests(scores, people).empty
    assert outcomes.score_table(scores, people, "condition").empty


@pytest.mark.parametrize("people", range(4, 13))
def test_orders_that_were_not_had_equally_often_are_told_with_their_numbers(people: int) -> None:
    names = ("a", "b", "c")
    found = factors_of(crossover(6, people, names)).uneven
    first = [sum(person % 3 == place for person in range(people)) for place in range(3)]
    if people % 3 == 0:
        assert found == ""
    else:
        assert found == (
            "Conditions were not equally frequent at each place: in 1 b1, "
            f"a for {first[0]}, b for {first[1]} and c for {first[2]} participants; plain means of "
            "conditions include part of the change from place to place, which their tests take out."
        )


def test_uneven_orders_are_told_beside_the_sample() -> None:
    factors = factors_of(crossover(6, 7, ("a", "b_1", "c")))
    results = Results("Seven people.", tested.COUNTS, factors)
    said = "in 1 b1, a for 3, b\\_1 for 2 and c for 2 participants"
    assert said in paragraphs(results, STYLES["tex"])[0]


def test_who_lacks_a_condition_does_not_count_in_whether_orders_are_even() -> None:
    movements = crossover(2, 10, ("plain", "tone"))
    gone = (movements["participant"] == "P003") & (movements["condition"] == "tone")
    assert "plain for 5 and tone for 4 participants" in factors_of(movements[~gone]).uneven
    both = gone | ((movements["participant"] == "P004") & (movements["condition"] == "tone"))
    assert factors_of(movements[~both]).uneven == ""
    assert factors_of(crossover(2, 9, ("plain", "tone"), balanced=False)).uneven == ""
    failed = movements["outcome"].mask(gone, "time_out")
    said = factors_of(movements.assign(outcome=failed)).uneven
    assert "plain for 5 and tone for 4 participants" in said


def test_power_tests_the_difference_of_conditions_as_the_report_does() -> None:
    movements = crossover(3, 16, ("plain", "tone"))
    effect = read_effect("movement_time~condition[plain,tone]")
    planned = plan_test("contrast", effect, movements, Claim("difference"))
    answer = ask(planned, planned.results)
    reported = of_condition(tested.contrast_table, movements)
    assert abs(answer.estimate) == pytest.approx(abs(reported["difference"]))
    assert answer.p == pytest.approx(reported["p"])


STUDY = SHORT.replace(
    "sessions:",
    """\
feedback: {tone: {use: sonification}}
design:
  conditions: {plain: none, tone: [tone]}
  order: {condition: latin_square, pairs: shuffled}
participants: {pattern: 'P\\d{3}', planned: 4}
sessions:""",
).replace(
    "      - block: {task: aiming, pairs: 1}\n",
    "      - block: {task: aiming, condition: 1}\n      - block: {task: aiming, condition: 2}\n",
)


@pytest.mark.slow
def test_a_crossover_goes_from_its_protocol_to_its_report(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    protocol, data, report = (tmp_path / name for name in ("study.yaml", "data", "report"))
    protocol.write_text(STUDY)
    assert main(["check", str(protocol)]) == 0
    assert main(["plan", str(protocol), "--participants", "4"]) == 0
    said = capsys.readouterr().out
    assert said.count("condition: tone") == said.count("condition: plain") == 4
    assert main(["simulate", str(protocol), "--participants", "4", "--out", str(data)]) == 0
    with without_figures():
        assert main(["report", str(data), "--include", "simulated", "--out", str(report)]) == 0
    tested = pd.read_csv(report / "tables" / "anova.csv")
    assert "condition" in set(tested["factor"])
    assert "over condition" in (report / "results.md").read_text()
    (tmp_path / "consent.txt").write_text("I agree.")
    approval = ["--board", "B", "--reference", "1", "--valid-until", "2099-12-31", "--consent"]
    assert main(["approve", str(protocol), *approval, str(tmp_path / "consent.txt")]) == 0
    capsys.readouterr()
    assert main(["methods", str(protocol)]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "had 2 conditions (plain without feedback; tone with the feedback tone)" in said
    assert "The levels of condition came in the orders of a Latin square" in said
