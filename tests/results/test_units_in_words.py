"""Every number in the report's words has the unit of its measure, of whatever it is."""

import re

import numpy as np
import pandas as pd
import pytest

from labcrane.analysis.report.factors import factors_of, with_factors
from labcrane.analysis.report.findings import Results, StudyFinding
from labcrane.analysis.report.words import STYLES, paragraphs
from labcrane.analysis.statistics.anova import Anova
from labcrane.analysis.statistics.trends import Trend
from labcrane.analysis.tables.definitions import MEASURES
from results import tested

UNITS = {"reaction_time": "s", **{name: unit for name, (unit, _) in MEASURES.items()}}
SAMPLE = "Twelve people."


def in_words(measure: str, scale: float) -> str:
    """Return the report's paragraph on a measure that people get better in."""
    dice = np.random.default_rng(475)
    rows = [
        {
            "participant": f"P{person:03}", "group": ("none", "slow")[person % 2], "session": 1,
            "sequence": place, "outcome": "success", "practice": 0.0, "pair": str(pair),
            "distance": (2.0, 4.0)[pair % 2], "difficulty": (2.0, 4.0)[pair % 2],
            measure: scale * (9.0 + person % 3 - 0.4 * place + pair % 2 + dice.normal(0.0, 0.4)),
        }
        for person in range(1, 13)
        for place, pair in enumerate(dice.permutation(6), start=1)
    ]  # fmt: skip
    whole = with_factors(pd.DataFrame(rows))
    factors = factors_of(whole)
    primary = (measure,)
    found = Results(
        SAMPLE,
        tested.COUNTS,
        factors,
        tested.every_finding(whole, factors, primary),
        primary,
        UNITS,
    )
    return " ".join(paragraphs(found, STYLES["html"]))


@pytest.mark.parametrize(
    ("measure", "scale"),
    [("constant_error", 0.01), ("reaction_time", 0.1), ("amplitude", 0.2), ("peak_speed_tip", 0.1)],
)
def test_steps_and_differences_of_an_outcome_have_its_unit(measure: str, scale: float) -> None:
    said = in_words(measure, scale)
    unit = re.escape(UNITS[measure])
    assert re.search(
        rf"it (?:fell by|did not detectably change:) .?[0-9.]+ {unit} each, 95 % CI", said
    ), said
    assert re.search(rf"4 m: .?[0-9.]+ {unit}, 95 % CI", said), said
    assert "  " not in said


@pytest.mark.parametrize("measure", ["sparc", "path_ratio"])
def test_an_outcome_without_a_unit_has_no_gap_where_it_would_be(measure: str) -> None:
    said = in_words(measure, -1.0 if measure == "sparc" else 1.0)
    assert re.search(
        r"it (fell by|rose by|did not detectably change:) .?[0-9.]+ each, 95 % CI", said
    ), said
    assert "  " not in said
    assert " 1 each" not in said


@pytest.mark.parametrize(
    ("slope", "p", "corrected", "said"),
    [
        (-0.12, 0.001, 0.004, "it fell by 0.12 s each"),
        (0.12, 0.001, float("nan"), "it rose by 0.12 s each"),
        (0.12, 0.04, 0.16, "it did not detectably change: 0.12 s each"),
        (-0.12, 0.992, float("nan"), "it did not detectably change: \N{MINUS SIGN}0.12 s each"),
        (-1.25e-16, 1.0, 1.0, "it did not detectably change: 0 s each"),
    ],
)
def test_a_trend_rose_or_fell_only_where_its_corrected_p_says_so(
    slope: float, p: float, corrected: float, said: str
) -> None:
    trend = Trend(
        *("movement_time", "sequence", slope, (slope - 0.1, slope + 0.1), 1.0, 9.0, p),
        dz=0.3, n=10, people=(), phase="1 b", p_holm=corrected,
    )  # fmt: skip
    test = Anova(
        "movement_time", "x", f=1.0, df1=1.0, df2=9.0, epsilon=1.0, epsilon_hf=1.0, p=0.3, p_gg=0.3,
        eta2p=0.1, n=10, people=(),
    )  # fmt: skip
    factors = factors_of(
        with_factors(
            pd.DataFrame({"participant": ["P001"], "sequence": [1.0], "movement_time": [1.0]})
        )
    )
    findings = [
        StudyFinding("anova", "movement_time", "x", test),
        StudyFinding("trends", "movement_time", "linear trend", trend),
    ]
    found = Results(SAMPLE, tested.COUNTS, factors, findings, units={"movement_time": "s"})
    assert said in paragraphs(found, STYLES["html"])[1]
