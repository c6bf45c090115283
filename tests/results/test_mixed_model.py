"""The mixed model of drawn people: against lme4, analysis of variance, and its own p."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from labcrane.analysis.report.factors import factors_of, with_factors
from labcrane.analysis.report.findings import Results
from labcrane.analysis.statistics.anova import analyse, compare
from labcrane.analysis.statistics.mixed import NoModelError, mixed_model
from results import tested
from results.consumers import needs_emmeans, r, table
from results.synthetic import cohort_of_36

TAILS = 4.0
"""Degrees of freedom of the t distribution that people's differences and errors are drawn from."""


def drawn(
    seed: int,
    *,
    people: int = 16,
    groups: tuple[str, ...] = ("none",) * 8 + ("visual",) * 8,
    sessions: int = 1,
    blocks: int = 2,
    conditions: str = "",
    differ: float = 0.4,
    lost: float = 0.0,
    absent: float = 0.0,
) -> pd.DataFrame:
    """Return movements of people who differ in all that varies within them, without any effect.

    Deviations of a person in a session, block, condition, side, and slopes over sequence and
    difficulty, and errors, are of one t distribution; ``differ`` is their size for what blocks and
    conditions are. ``lost`` movements and ``absent`` phases are not there.
    """
    dice = np.random.default_rng([17, seed])

    def own(size: float, *shape: int) -> Any:
        return size * dice.standard_t(TAILS, shape) * math.sqrt((TAILS - 2.0) / TAILS)

    rows = []
    for who in range(people):
        mean, side, slope, harder = own(1.0), own(0.2, 2), own(0.03), own(0.1)
        of_session, of_phase = own(differ, sessions), own(differ, sessions, blocks)
        of_block, of_condition = own(differ, blocks), own(differ, len(conditions) or 1)
        for phase, (session, block) in enumerate(np.ndindex(sessions, blocks)):
            if phase and dice.random() < absent:
                continue
            turn = (phase + who) % (len(conditions) or 1)
            for place, pair in enumerate(dice.permutation(8)):
                if dice.random() < lost:
                    continue
                y = mean + of_phase[session, block] + of_condition[turn] + side[pair % 2]
                y += slope * place + (0.5 + harder) * (pair // 2) + own(0.5)
                y += (of_session[session] + of_block[block]) * (sessions > 1)
                rows.append(
                    {"participant": f"P{who:03}", "group": groups[who % len(groups)],
                     "phase": f"{phase + 1}", "of_session": f"{session}", "of_block": f"{block}",
                     "condition": conditions[turn : turn + 1], "sequence": place + 1.0,
                     "difficulty": 2.0 + 0.7 * (pair // 2), "far_side": ("left", "right")[pair % 2],
                     "y": float(y)}
                )  # fmt: skip
    return pd.DataFrame(rows)


UNEQUAL = ("none",) * 11 + ("visual",) * 5
DESIGNS: dict[str, dict[str, Any]] = {
    "two groups before and after": {},
    "few people": {"people": 8, "groups": ("none", "visual")},
    "unequal groups with missing cells": {"groups": UNEQUAL, "lost": 0.2, "absent": 0.15},
    "three blocks with missing cells": {"blocks": 3, "lost": 0.2, "absent": 0.1},
    "people who hardly differ": {"differ": 0.1},
    "people who do not differ": {"differ": 0.0},
    "a crossover": {"groups": ("",), "conditions": "uv"},
    "a crossover of four blocks": {"groups": ("",), "conditions": "uv", "blocks": 4},
    "a crossover of three": {"groups": ("",), "conditions": "uvw", "blocks": 3, "people": 18},
    "a crossover of two groups": {"conditions": "uv", "lost": 0.1},
    "blocks in sessions": {"groups": ("",), "sessions": 2},
}
"""Studies of people without an effect."""

IN_R = {
    "two groups before and after": "group * phase + group:s + (1 | participant:phase)",
    "unequal groups with missing cells": "group * phase + group:s + (1 | participant:phase)",
    "three blocks with missing cells": "group * phase + group:s + (1 | participant:phase)",
    "people who do not differ": "group * phase + group:s + (1 | participant:phase)",
    "a crossover": "phase + condition + (1 | participant:condition)",
    "a crossover of four blocks": "phase + condition + (1 | participant:condition)"
    " + (1 | participant:phase)",
    "a crossover of two groups": "group * (s + phase + condition) + (1 | participant:condition)",
    "blocks in sessions": "phase + (1 | participant:of_session) + (1 | participant:of_block)"
    " + (1 | participant:phase)",
}
"""What lme4 is told of a design, besides what every design has."""

LME4 = """
suppressMessages(library(lme4))
d <- read.csv(commandArgs(TRUE)[1], colClasses = c(phase = "character"))
for (cohort in unique(d$cohort)) {
  own <- d[d$cohort == cohort, ]
  own$s <- own$sequence - mean(own$sequence); own$b <- own$difficulty - mean(own$difficulty)
  model <- as.formula(paste("y ~ s + b + far_side + (1 | participant) + (0 + s | participant)",
    "+ (0 + b | participant) + (1 | participant:far_side) +", own$design[1]))
  mm <- suppressWarnings(suppressMessages(lmer(model, own,
    control = lmerControl(optimizer = "bobyqa", optCtrl = list(rhoend = 1e-9)))))
  # CR2 by matrices of all movements, where the movements are weighted to the identity.
  v <- diag(nrow(own)) + as.matrix(crossprod(getME(mm, "Lambdat") %*% getME(mm, "Zt")))
  white <- solve(t(chol(v)))
  x <- white %*% getME(mm, "X"); y <- white %*% own$y
  m <- solve(crossprod(x)); left <- diag(nrow(own)) - x %*% m %*% t(x); e <- left %*% y
  parts <- lapply(unique(own$participant), function(who) {
    at <- which(own$participant == who)
    root <- eigen(left[at, at], symmetric = TRUE)
    root <- root$vectors %*% (t(root$vectors) / sqrt(root$values))
    list(at = at, g = root %*% x[at, ] %*% m)
  })
  for (k in seq_len(ncol(x))) {
    g <- sapply(parts, function(p) replace(numeric(nrow(own)), p$at, p$g[, k]))
    inside <- t(g) %*% left %*% g
    df <- sum(diag(inside))^2 / sum(inside^2)
    se <- sqrt(sum((t(g) %*% e)^2)); estimate <- fixef(mm)[[k]]
    name <- paste(sort(strsplit(names(fixef(mm))[k], ":")[[1]], method = "radix"), collapse = ":")
    say(paste(cohort, name), estimate, se, df, estimate / se, 2 * pt(-abs(estimate / se), df))
  }
  say(paste(cohort, "fit"), REMLcrit(mm), isSingular(mm))
}
"""


def of_r(term: str) -> str:
    """Return a term as R names it: ``groupvisual:phase2``; the parts in any order."""
    named = {"Intercept": "(Intercept)", "sequence": "s", "difficulty": "b"}
    parts = [named.get(part, part) for part in term.replace("[T.", "").replace("]", "").split(":")]
    return ":".join(sorted(parts))


@pytest.mark.slow
@needs_emmeans
def test_the_mixed_model_is_that_of_lme4_and_its_errors_are_cr2_over_people(tmp_path: Path) -> None:
    cohorts = {
        f"{name} {at}": drawn(at, **DESIGNS[name]).assign(design=model)
        for name, model in IN_R.items()
        for at in range(5)
    }
    path = tmp_path / "movements.csv"
    pd.concat([own.assign(cohort=name) for name, own in cohorts.items()]).to_csv(path, index=False)
    theirs = {key: np.array(found, float) for key, found in table(r(LME4, path)).items()}
    singular = equal = 0
    for name, own in cohorts.items():
        model = mixed_model(own, "y")
        assert (model.log, model.n, model.missing) == (False, len(own), 0)
        criterion, is_singular = theirs[f"{name} fit"]
        # Near a boundary lmer stops early in some; ours may be a better fit, never a worse one.
        assert model.criterion < criterion + 1e-6, name
        singular += bool(model.zero)
        if model.criterion < criterion - 1e-6:
            continue
        equal += 1
        assert bool(model.zero) == is_singular, name
        terms = model.terms[["estimate", "se", "df", "t", "p"]].to_numpy(float)
        there = np.array([theirs[f"{name} {of_r(term)}"] for term in model.terms["term"]])
        off = np.abs(terms[:, 0] - there[:, 0]) / there[:, 1]
        assert off.max() < 2e-3, name
        np.testing.assert_allclose(terms[:, 1], there[:, 1], rtol=2e-3, err_msg=name)
        np.testing.assert_allclose(terms[:, 2], there[:, 2], rtol=2e-2, err_msg=name)
        np.testing.assert_allclose(terms[:, 4], there[:, 4], atol=1e-3, err_msg=name)
    assert 0 < singular < len(cohorts), "both kinds are drawn"
    assert equal > 0.9 * len(cohorts)


def significant(design: str, cohorts: range) -> pd.DataFrame:
    """Return which terms are below .05, one row per cohort; the difficulty is no null term."""
    rows = [mixed_model(drawn(at, **DESIGNS[design]), "y").terms for at in cohorts]
    found = [own.set_index("term")["p"].drop(["Intercept", "difficulty"]) < 0.05 for own in rows]
    return pd.DataFrame(found).astype(float)


@pytest.mark.long
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("design", DESIGNS)
def test_the_table_of_type_i_errors(design: str) -> None:
    found = significant(design, range(1_000, 2_000)).mean()
    assert found.between(0.03, 0.07).all(), found.to_string()


def of_unlike_people(
    seed: int,
    *,
    people: int = 16,
    groups: tuple[str, ...] = ("none", "visual"),
    days: tuple[int, ...] = (3, 1),
    conditions: str = "",
    day: float = 0.15,
    phase: tuple[float, ...] = (0.02,),
    shared: float = 0.0,
    tails: float = math.inf,
    lost: float = 0.0,
    absent: float = 0.0,
) -> pd.DataFrame:
    """Return movements whose variances over people no model of one variance for each factor has.

    A day of a person moves all its phases, phases have spreads of their own, and the response to
    all conditions except the first is the same within a person. Without any effect.
    """
    dice = np.random.default_rng([23, seed])

    def own(size: Any, *shape: int) -> Any:
        scale = np.sqrt((tails - 2.0) / dice.chisquare(tails, shape)) if tails < math.inf else 1.0
        return size * scale * dice.standard_normal(shape)

    today, several = np.repeat(np.arange(len(days)), days), len(conditions) or 1
    rows = []
    for who in range(people):
        order = np.roll(np.arange(several), who)[:: 1 if who // several % 2 else -1]
        mean, of_day, response = own(0.2), own(day, len(days)), own(shared)
        of_phase = own(np.resize(phase, len(today)), len(today))
        of_condition = own(phase[0], several) * (several > 1)
        for at in range(len(today)):
            if at and dice.random() < absent:
                continue
            turn = int(order[at % several])
            level = mean + of_day[today[at]] + of_phase[at] + of_condition[turn]
            level += response * (turn > 0)
            for place, pair in enumerate(dice.permutation(8)):
                if dice.random() < lost:
                    continue
                rows.append(
                    {"participant": f"P{who:03}", "group": groups[who % len(groups)],
                     "phase": f"{at + 1}", "condition": conditions[turn : turn + 1],
                     "sequence": place + 1.0, "difficulty": 2.0 + pair // 4,
                     "far_side": ("left", "right")[pair % 2],
                     "y": float(level + 0.4 * (pair // 4) + own(0.12))}
                )  # fmt: skip
    return pd.DataFrame(rows)


CROSSOVER: dict[str, Any] = {
    "groups": ("",), "days": (1, 1, 1), "conditions": "uvw", "phase": (0.03,), "day": 0.0,
    "shared": 0.1,
}  # fmt: skip
UNLIKE: dict[str, dict[str, Any]] = {
    "retention on another day": {},
    "few people, heavy tails": {"people": 10, "tails": TAILS},
    "phases of unlike spread, unequal groups, missing cells": {
        "groups": UNEQUAL, "phase": (0.02, 0.04, 0.08, 0.16), "lost": 0.15, "absent": 0.1,
    },
    "many people, heavy tails, missing cells": {
        "people": 24, "phase": (0.2, 0.02, 0.02, 0.1), "tails": TAILS, "lost": 0.1, "absent": 0.15,
    },
    "one response to two feedbacks": {"people": 18, **CROSSOVER},
    "one response of few people": {"people": 12, "lost": 0.1, **CROSSOVER},
    "one response of eight people, heavy tails": {"people": 8, "tails": TAILS, **CROSSOVER},
}  # fmt: skip
"""Studies of such people."""


@pytest.mark.long
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("design", UNLIKE)
def test_the_table_of_type_i_errors_of_unlike_people(design: str) -> None:
    rows = [mixed_model(of_unlike_people(at, **UNLIKE[design]), "y").terms for at in range(1_000)]
    p = pd.DataFrame([own.set_index("term")["p"] for own in rows])
    found = (p.drop(columns=["Intercept", "difficulty"]) < 0.05).mean()
    assert found.between(0.03, 0.07).all(), found.to_string()


@pytest.mark.parametrize("differ", [0.0, 0.2, 0.5])
def test_in_a_balanced_design_the_model_and_the_analysis_of_variance_agree(differ: float) -> None:
    """However much people differ from phase to phase, and so in phases of another spread too."""
    for at in range(3):
        both = drawn(at, differ=differ)
        rows = {row.factor: row for row in analyse(both, "y", ["phase"], ["group"])}
        theirs = rows["group:phase"]
        ours = mixed_model(both, "y").terms.set_index("term").loc["group[T.visual]:phase[T.2]"]
        assert (ours["t"] ** 2, ours["df"]) == pytest.approx((theirs.f, theirs.df2), rel=1e-3)
        assert ours["p"] == pytest.approx(theirs.p, abs=1e-3)
        three = of_unlike_people(at, groups=("",), phase=(differ, 0.1, 0.02, 0.3))
        terms = mixed_model(three, "y").terms.set_index("term")
        for one in compare(three, "y", "phase", ["phase"])[:3]:
            ours = terms.loc[f"phase[T.{one.second}]"]
            assert ours["estimate"] == pytest.approx(-one.difference, rel=1e-6)
            assert (ours["se"], ours["df"]) == pytest.approx((one.se, one.df), rel=1e-6)


def test_a_term_that_rests_on_one_participant_is_not_tested() -> None:
    cohort = drawn(4, blocks=3, groups=UNEQUAL)
    last = (cohort["group"] == "visual") & (cohort["phase"] == "3")
    (one, *_) = cohort["participant"][last]
    model = mixed_model(cohort[~last | (cohort["participant"] == one)], "y")
    untested = set(model.terms["term"][model.terms["p"].isna()])
    assert untested == {"group[T.visual]:phase[T.3]"}
    assert model.terms["se"].isna().sum() == 1


def test_conditions_of_blocks_in_one_order_are_said_to_be_one_with_the_blocks() -> None:
    crossed = drawn(3, groups=("",), conditions="uv")
    model = mixed_model(crossed, "y")
    assert model.dropped == ()
    assert model.inseparable == ("(1 | participant:phase)",)
    assert "condition + (1 | participant)" in model.formula
    alike = crossed.assign(condition=crossed["phase"].map({"1": "u", "2": "v"}))
    model = mixed_model(alike, "y")
    assert model.dropped == ("condition[T.v]",)
    confounded = model.terms.set_index("term")["confounded"]
    assert confounded[confounded != ""].to_dict() == {"phase[T.2]": "condition[T.v]"}


def test_people_differ_by_session_and_block_only_where_each_session_has_the_same_blocks() -> None:
    crossed = drawn(2, groups=("",), sessions=2)
    named = {"(1 | participant:session)", "(1 | participant:block)", "(1 | participant:phase)"}
    model = mixed_model(crossed, "y")
    assert named <= {*model.random, *model.zero}
    model = mixed_model(crossed[crossed["phase"] != "4"], "y")
    assert named & {*model.random, *model.zero} == {"(1 | participant:phase)"}
    assert model.inseparable == ()


def test_blocks_without_a_condition_are_no_reference_of_conditions() -> None:
    crossed = drawn(5, groups=("",), conditions="uv", blocks=2)
    before = crossed[crossed["phase"] == "1"].assign(phase="0", condition=np.nan)
    model = mixed_model(pd.concat([before, crossed]), "y")
    assert set(model.terms["term"][4:]) == {"phase[T.1]", "phase[T.2]", "condition[T.v]"}
    assert model.dropped == ("condition[T.no condition]",)


@pytest.fixture(scope="module")
def two_groups() -> pd.DataFrame:
    """Two groups in two phases; the second phase changes the signed error of one of them."""
    parts = [cohort_of_36(seed).assign(phase=name) for seed, name in ((7, "first"), (8, "second"))]
    both = pd.concat(parts, ignore_index=True)
    visual = both["participant"].str[1:].astype(int) % 2 == 0
    both["group"] = np.where(visual, "visual", "none")
    dice = np.random.default_rng(3)
    own = both["participant"].map(dict.fromkeys(sorted(set(both["participant"])), 0.0))
    for name in sorted(set(both["participant"])):
        own[both["participant"] == name] = dice.normal(0.0, 0.03)
    both["error_along"] += own + 0.06 * (visual & (both["phase"] == "second"))
    both["sparc"] = -1.8 - 0.1 * both["difficulty"] + own + dice.normal(0.0, 0.05, len(both))
    return both


@pytest.mark.parametrize("value", [0.0, 0.1, 0.1 + 0.2, 7.3])
@pytest.mark.parametrize("missing", [0, 9])
def test_a_measure_that_is_the_same_in_all_is_tested_by_nothing(
    two_groups: pd.DataFrame, value: float, missing: int
) -> None:
    few = two_groups[two_groups["participant"] <= "P008"].reset_index(drop=True)
    few = few.assign(session=few["phase"].map({"first": 1.0, "second": 2.0}))
    constant = pd.Series(value, few.index)
    constant[np.random.default_rng(5).choice(few.index, missing, replace=False)] = np.nan
    few = few.drop(columns="phase").assign(constant=constant, practice=0.0, outcome="success")
    table = with_factors(few)
    factors, asked = factors_of(table), ["constant"]
    found = Results("", tested.COUNTS, factors, tested.every_finding(table, factors, asked))
    tables = ("anova", "contrasts", "trends", "time_scales", "time_scales_by_group")
    for made in map(found.table, tables):
        assert set(made["measure"]) - {"constant"}, "other measures are tested"
        own = made[made["measure"] == "constant"]
        assert own["p"].isna().all()
    with pytest.raises(NoModelError, match="all movements have the same value"):
        mixed_model(table, "constant")


@pytest.mark.parametrize(
    ("values", "why"),
    [
        (lambda t: 2.0 * t["difficulty"], "no residual variance"),
        (lambda t: t["participant"].factorize()[0] * 0.1, "no residual variance"),
        (lambda t: t["participant"].factorize()[0] * t["sequence"], "no residual variance"),
        (lambda t: t["sequence"] / 3.0, "no residual variance"),
        (lambda t: (t["group"] == "visual") * 1.0, "no residual variance"),
        (lambda t: t["y"].where(t["y"] < t["y"].max(), np.inf), "some values are infinite"),
    ],
)
def test_a_measure_without_scatter_has_no_model_and_says_why(
    values: Callable[[pd.DataFrame], pd.Series], why: str
) -> None:
    cohort = drawn(12)
    with pytest.raises(NoModelError, match=why):
        mixed_model(cohort.assign(y=values(cohort)), "y")


def test_a_time_of_0_is_kept_and_the_time_modelled_as_it_is(two_groups: pd.DataFrame) -> None:
    few = two_groups[two_groups["participant"] <= "P006"].reset_index(drop=True)
    zero = few.assign(reaction_time=few["movement_time"].where(few.index != 5, 0.0))
    model = mixed_model(zero, "reaction_time")
    assert (model.log, model.n) == (False, len(few))
    assert mixed_model(few.assign(reaction_time=few["movement_time"]), "reaction_time").log


def test_groups_that_lack_a_phase_are_modelled_without_their_interaction(
    two_groups: pd.DataFrame,
) -> None:
    few = two_groups[two_groups["participant"] <= "P010"]
    model = mixed_model(few, "movement_time")
    assert "group[T.visual]:phase[T.second]" in set(model.terms["term"])
    lacking = few[(few["group"] == "none") | (few["phase"] == "first")]
    model = mixed_model(lacking, "movement_time")
    assert "phase[T.second]" in set(model.terms["term"])
    assert "group[T.visual]:phase[T.second]" not in set(model.terms["term"])
    assert model.dropped == ("group[T.visual]:phase[T.second]",)
