"""Sessions and blocks are two factors where each session has the same blocks, against R."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from labcrane.analysis.report.factors import Factors, factors_of, with_factors
from labcrane.analysis.report.findings import Results, of_outcomes
from labcrane.analysis.report.outcomes import StudyMovements
from labcrane.analysis.report.words import STYLES, UNBALANCED, paragraphs
from labcrane.simulation.power import Claim, read_effect
from labcrane.simulation.reported import ask, plan_test
from results import tested
from results.consumers import needs_emmeans, r, table

BLOCKS = {1: ("guided", "free"), 2: ("guided", "free")}
PLACES = 4


def drawn(seed: int, blocks: dict[int, tuple[str, ...]]) -> pd.DataFrame:
    """Return two unequal groups; practice is block 1 of the first session, so that numbers shift.

    Somebody lacks one block.
    """
    dice = np.random.default_rng(seed)
    people = ["none"] * int(dice.integers(5, 8)) + ["slow"] * int(dice.integers(8, 11))
    pairs = [(2.0, "left"), (2.0, "right"), (4.0, "left"), (4.0, "right")]
    rows = [
        {
            "participant": f"P{person:03}", "group": group, "session": session,
            "session_name": ("acquisition", "retention")[session - 1],
            "block": number + (session == 1), "block_name": name,
            "sequence": place + PLACES * number,
            "distance": pairs[at][0], "difficulty": pairs[at][0], "far_side": pairs[at][1],
            "pair": f"{pairs[at][0]:g} {pairs[at][1]}", "outcome": "success",
            "practice": float(number == 0),
            "movement_time": person % 3 + 9.0 - 0.3 * place - 0.4 * session * (name == "free")
            + dice.normal(0.0, 0.5),
        }
        for person, group in enumerate(people, start=1)
        for session, names in blocks.items()
        for number, name in enumerate(("aside", *names) if session == 1 else (None, *names))
        if name
        for place, at in enumerate(dice.permutation(PLACES), start=1)
    ]  # fmt: skip
    whole = pd.DataFrame(rows)
    lacking = f"P{int(dice.integers(1, len(people) + 1)):03}"
    gone = (whole["participant"] == lacking) & (whole["session"] == 2)
    return whole[~(gone & (whole["block_name"] == "free"))].reset_index(drop=True)


def told(seed: int, blocks: dict[int, tuple[str, ...]]) -> tuple[pd.DataFrame, Factors]:
    whole = with_factors(drawn(seed, blocks))
    return whole[whole["practice"] == 0.0], factors_of(whole)


AFEX = """
suppressMessages({library(afex); library(emmeans)})
d <- read.csv(commandArgs(TRUE)[1])
d$distance <- factor(d$distance)
say <- function(...) cat(..., sep = "|", fill = 10000)
number <- function(...) sprintf("%.17g", c(...))
both <- c("of_session", "of_block")
for (last in list(character(0), "place", "distance", "far_side")) {
  fit <- suppressMessages(suppressWarnings(aov_ez("participant", "movement_time", d,
    within = c(both, last), between = "group", fun_aggregate = mean)))
  plain <- anova(fit, es = "pes", correction = "none")
  gg <- anova(fit, es = "pes", correction = "GG")
  for (effect in rownames(plain)) if (all(last %in% strsplit(effect, ":")[[1]]))
    say(paste("anova", effect), number(
      plain[effect, "F"], plain[effect, "num Df"], plain[effect, "den Df"], gg[effect, "num Df"],
      gg[effect, "den Df"], gg[effect, "Pr(>F)"], gg[effect, "pes"]))
  if (!length(last)) for (factor in both) {
    means <- suppressMessages(emmeans(fit, factor, model = "multivariate"))
    s <- summary(contrast(means, "pairwise"))
    say(paste("contrast", factor), number(s$estimate, s$SE, s$df, s$t.ratio, s$p.value))
  }
}
"""
WORDS = {"of_session": "session", "of_block": "block", "place": "sequence"}


@pytest.mark.slow
@needs_emmeans
@pytest.mark.parametrize("seed", [420, 421])
def test_sessions_with_the_same_blocks_are_two_factors_as_afex_has_them(
    seed: int, tmp_path: Path
) -> None:
    done, factors = told(seed, BLOCKS)
    done.to_csv(tmp_path / "movements.csv", index=False)
    theirs = table(r(AFEX, tmp_path / "movements.csv"))
    assert len(theirs) == 7 + 3 * 8 + 2
    tested.compare_with_afex(theirs, done, factors, WORDS, "p")
    tests = tested.anova_table(done, factors).set_index("factor")
    people = done["participant"].nunique()
    assert set(tests.loc[["session", "block", "session:block"], "n"]) == {people - 1}


@pytest.mark.slow
def test_learning_goes_from_the_last_block_of_a_session_to_the_first_of_the_next() -> None:
    done, factors = told(7, BLOCKS)
    assert factors.phases == (
        "1 acquisition, guided", "2 acquisition, free", "3 retention, guided", "4 retention, free",
    )  # fmt: skip
    scales = tested.time_scales(done, factors)
    own = scales[scales["group"] == "all"]
    found = own.groupby("quantity")["phase"].agg(list)
    assert found["change"] == list(factors.phases[1:])
    assert found["difference score"] == found["net gain"] == ["3 retention, guided"]
    before = done.assign(pair="one")  # nothing is taken away
    scales = tested.time_scales(before, factors)
    row = scales[(scales["quantity"] == "difference score") & (scales["group"] == "all")]
    cells = done.groupby(["participant", "phase", "place"])["movement_time"].mean().unstack([1, 2])
    last = cells["2 acquisition, free"][float(PLACES)]
    change = cells["3 retention, guided"][1.0] - last
    assert row["mean"].item() == pytest.approx(change.mean(), rel=1e-12)


@pytest.mark.parametrize("second", [("free",), ("free", "guided")])
def test_sessions_with_other_blocks_are_one_factor_of_phases_and_it_is_said(
    second: tuple[str, ...],
) -> None:
    done, factors = told(8, {1: ("guided", "free"), 2: second})
    assert (factors.crossed, factors.over_phases, factors.unbalanced) == ({}, ["phase"], True)
    tests = tested.anova_table(done, factors)
    assert "phase" in set(tests["factor"])
    assert not {"session", "block"} & set(tests["factor"])
    results = Results(
        "All.", tested.COUNTS, factors, list(of_outcomes(StudyMovements(done, done, factors)))
    )
    assert UNBALANCED in paragraphs(results, STYLES["html"])[0]
    _, even = told(8, BLOCKS)
    assert not even.unbalanced


@pytest.mark.parametrize("text", ["session", "block", "session:block", "group:block"])
def test_power_is_of_the_two_factors_that_the_report_prints(text: str) -> None:
    whole = drawn(9, BLOCKS)
    done, factors = told(9, BLOCKS)
    planned = plan_test("anova", read_effect(f"movement_time~{text}"), whole, Claim())
    rows = tested.anova_table(done, factors).set_index("factor")
    assert ask(planned, planned.results).p == pytest.approx(rows.loc[text, "p_gg"], rel=1e-9)
    if ":" in text:
        return
    contrasts = tested.contrast_table(done, factors)
    (row,) = contrasts[(contrasts["factor"] == text) & (contrasts["at"] == "")].to_dict("records")
    effect = read_effect(f"movement_time~{text}[{row['first']},{row['second']}]")
    asked = plan_test("contrast", effect, whole, Claim())
    assert ask(asked, asked.results).estimate == pytest.approx(-row["difference"])
