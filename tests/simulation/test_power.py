"""The power of planned tests, against the power that theory gives them."""

from itertools import product

import numpy as np
import pandas as pd
import pytest
from statsmodels.stats.power import TTestIndPower, TTestPower

from labcrane.errors import ProtocolError
from labcrane.simulation.power import Effect, make_pool, power, read_effect

SIZES = (8, 16, 32)
COHORTS = 2000
ERROR = 4.0 * np.sqrt(0.25 / COHORTS)
"""Four standard errors of a share, where it varies most."""


def within(slope: float, spread: float, participants: int = 4000, levels: int = 8) -> pd.DataFrame:
    """Return movements with a slope over the sequence that varies over participants."""
    random = np.random.default_rng(3)
    slopes = random.normal(slope, spread, participants)
    steps = np.arange(1.0, levels + 1.0)
    values = 5.0 + np.outer(slopes, steps) + random.normal(0.0, 0.2, (participants, levels))
    rows = [(f"P{p:04}", s) for p, s in product(range(participants), steps)]
    table = pd.DataFrame(rows, columns=["participant", "sequence"])
    table["movement_time"] = values.ravel()
    table["half"] = np.where(table["sequence"] <= levels / 2, "early", "late")
    return table


def groups(difference: float, participants: int = 4000) -> pd.DataFrame:
    random = np.random.default_rng(4)
    label = np.arange(participants) % 2
    return pd.DataFrame(
        {
            "participant": [f"P{p:04}" for p in range(participants)],
            "group": np.array(["none", "visual"])[label],
            "movement_time": 5.0 + difference * label + random.normal(0.0, 1.0, participants),
        }
    )


@pytest.mark.parametrize("dz", [0.3, 0.7])
def test_the_power_of_a_trend_is_that_of_the_t_test(dz: float) -> None:
    movements = within(slope=1.0, spread=1.0 / dz)
    pool = make_pool(movements, read_effect("movement_time~sequence"))
    slopes = pool.means @ pool.weights
    # The pool stands for the population: its own effect size is what cohorts are drawn from.
    size = float(slopes.mean() / slopes.std())
    for found in power(pool, read_effect("movement_time~sequence"), SIZES, COHORTS, seed=1):
        expected = TTestPower().power(size, found.participants, 0.05)
        assert found.power == pytest.approx(expected, abs=ERROR)
        assert found.power_low < found.power < found.power_high


def test_where_nothing_is_something_is_found_as_often_as_alpha_says() -> None:
    effects = ("movement_time~sequence", "movement_time~half", "movement_time~sequence=0")
    for text in effects:
        pool = make_pool(within(slope=0.5, spread=0.3), read_effect(text))
        for found in power(pool, read_effect(text), SIZES, COHORTS, seed=2):
            assert found.null == pytest.approx(0.05, abs=4.0 * np.sqrt(0.05 * 0.95 / COHORTS))
            if text.endswith("=0"):
                assert found.power == found.null


def test_an_effect_that_is_put_in_is_the_one_that_is_found() -> None:
    effect = read_effect("movement_time~sequence=-0.03")
    pool = make_pool(within(slope=0.2, spread=0.0), effect)
    # Permuted, a participant's slope has the spread of a sum of randomly ordered values.
    levels = len(pool.steps)
    own = ((pool.means - pool.means.mean(axis=1, keepdims=True)) ** 2).sum(axis=1) / (levels - 1)
    spread = np.sqrt(own.mean() * (pool.weights @ pool.weights))
    for found in power(pool, effect, SIZES, COHORTS, seed=3):
        expected = TTestPower().power(0.03 / spread, found.participants, 0.05)
        assert found.power == pytest.approx(expected, abs=ERROR)


@pytest.mark.parametrize("text", ["movement_time~group", "movement_time~group[none,visual]=0.8"])
def test_the_power_between_groups_is_that_of_the_t_test(text: str) -> None:
    difference = 0.0 if "=" in text else 0.8
    pool = make_pool(groups(difference), read_effect(text))
    for found in power(pool, read_effect(text), SIZES, COHORTS, seed=4):
        expected = TTestIndPower().power(0.8, found.participants / 2, 0.05)
        assert found.power == pytest.approx(expected, abs=ERROR + 0.02)  # of Welch's test
        assert found.null == pytest.approx(0.05, abs=4.0 * np.sqrt(0.05 * 0.95 / COHORTS) + 0.005)


def test_fresh_cohorts_share_no_participant() -> None:
    effect = read_effect("movement_time~sequence")
    pool = make_pool(within(slope=1.0, spread=2.0, participants=100), effect)
    (found,) = power(pool, effect, (10,), 10, seed=5, fresh=True)
    from scipy.stats import ttest_1samp

    cohorts = (pool.means @ pool.weights).reshape(10, 10)
    expected = np.mean([ttest_1samp(cohort, 0.0).pvalue < 0.05 for cohort in cohorts])
    assert found.power == expected
    with pytest.raises(ProtocolError, match="two cohorts of 60 need 120 participants"):
        list(power(pool, effect, (60,), 11, seed=5, fresh=True))


@pytest.mark.parametrize(
    ("text", "effect"),
    [
        (
            "movement_time~sequence",
            Effect("movement_time", log=False, factor="sequence", between=(), size=None),
        ),
        (
            "log(error)~group[a,b]=0.2",
            Effect("error", log=True, factor="group", between=("a", "b"), size=0.2),
        ),
    ],
)
def test_effects_are_read_as_they_are_written(text: str, effect: Effect) -> None:
    assert read_effect(text) == effect


@pytest.mark.parametrize("text", ["movement_time", "log(x~y", "x~y=much", "~y"])
def test_what_is_no_effect_is_refused_with_examples(text: str) -> None:
    with pytest.raises(ProtocolError, match="is no effect; write MEASURE~FACTOR"):
        read_effect(text)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("speed~sequence", "movements have no 'speed'; they have participant"),
        ("movement_time~pair", r"'pair' has 3 levels here \(a, b, c\); the test is for"),
    ],
)
def test_what_cannot_be_tested_is_said(text: str, message: str) -> None:
    movements = within(1.0, 1.0, participants=3, levels=6)
    movements["pair"] = ["a", "b", "c"] * 6
    with pytest.raises(ProtocolError, match=message):
        make_pool(movements, read_effect(text))
