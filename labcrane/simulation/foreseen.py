"""Tests that the report of a study will make, derived from its plan before anyone takes part."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd

from labcrane.analysis.measures import ordered
from labcrane.analysis.report import outcomes
from labcrane.analysis.report.factors import factors_of, with_factors
from labcrane.analysis.report.findings import of_outcomes
from labcrane.analysis.report.outcomes import StudyMovements
from labcrane.analysis.statistics.anova import Anova
from labcrane.design.plan import plan_session
from labcrane.protocol.study import Study
from labcrane.simulation.rehearsal import planned_names

OF_AIMING = {"distance", "far_side", "difficulty"}
"""Columns of the trials of which the report makes its tests."""


def foreseen_tests(study: Study) -> pd.DataFrame:
    """Return the factors over which the report will test each outcome, as in its table ``anova``.

    Each planned participant has each planned trial, with times drawn at random, so that what can be
    tested, and told apart, follows from the plan alone. Empty where no trial is an aimed movement.

    Returns
    -------
    DataFrame
        ``factor``, ``n`` and ``confounded`` of each test.
    """
    trials = pd.DataFrame(_trials(study))
    aimed = trials.dropna(subset=[*OF_AIMING]) if set(trials) >= OF_AIMING else trials.iloc[:0]
    if not len(aimed):
        return pd.DataFrame(columns=["factor", "n", "confounded"])
    each = [ordered(own) for _, own in aimed.groupby(["participant", "session"], sort=False)]
    table = pd.concat(each, ignore_index=True)
    dice = np.random.default_rng(0)
    people = dict(zip(table["participant"], dice.normal(size=len(table)), strict=True))
    table["movement_time"] = table["participant"].map(people) + dice.normal(size=len(table))
    whole = with_factors(table)
    found = of_outcomes(StudyMovements(whole, whole, factors_of(whole), ["movement_time"]))
    tests = [one.test for one in found if one.measure == "movement_time"]
    rows = [(one.factor, one.n, one.confounded) for one in tests if isinstance(one, Anova)]
    return pd.DataFrame(rows, columns=["factor", "n", "confounded"])


def _trials(study: Study) -> Iterator[dict[str, Any]]:
    """Yield the row of the trial table of each planned trial that counts."""
    for slot, name in enumerate(planned_names(study), start=1):
        for number in range(1, len(study.protocol.sessions) + 1):
            plan = plan_session(study, name, number, slot)
            for block in plan.blocks:
                for trial in block.trials:
                    if block.practice or not trial.planned.counted:
                        continue
                    on = block.feedback.get(trial.number, ())
                    yield {
                        "participant": name,
                        "group": plan.group,
                        "session": float(number),
                        "session_name": plan.name,
                        "block": float(block.number),
                        "block_name": block.name,
                        "practice": 0.0,
                        "outcome": "success",
                        "trial": float(trial.number),
                        "feedback": "+".join(on) or "none",
                        **trial.planned.condition,
                    }


def in_words(tests: pd.DataFrame) -> str:
    """Return the tests in a sentence; empty where there are none."""
    if not len(tests):
        return ""
    plain = tests[~tests["factor"].str.endswith(outcomes.ADJUSTED)]
    named = [
        f"{row['factor']} (cannot be told from {row['confounded']})"
        if row["confounded"]
        else str(row["factor"])
        for row in plain.to_dict("records")
    ]
    return f"the report will test each outcome over {'; '.join(named)}"
