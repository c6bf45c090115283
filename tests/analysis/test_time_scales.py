"""Two time scales of learning, of people whose learning is known."""

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from labcrane.analysis.statistics.time_scales import quantities, summary

PEOPLE, PHASES, PLACES = 9, 3, 6
PAIRS = {"near": -0.7, "far": 1.9}
"""What each pair of targets adds to everybody's time, in seconds."""


@pytest.fixture(params=range(20))
def curves(request: pytest.FixtureRequest) -> np.ndarray:
    """Each person's own time by phase and place, in seconds."""
    draw = np.random.default_rng(request.param)
    return draw.uniform(2.0, 9.0, (PEOPLE, PHASES, PLACES))


@pytest.fixture
def found(curves: np.ndarray) -> pd.DataFrame:
    rows = [
        {
            "participant": f"P{person:03}",
            "group": "slow" if person % 3 == 0 else "none",
            "phase": f"{phase + 1} session",
            "place": place + 1,
            "pair": pair,
            "movement_time": curves[person, phase, place] + more,
        }
        for person in range(PEOPLE)
        for phase in range(PHASES)
        for place in range(PLACES)
        for pair, more in PAIRS.items()
    ]
    # In which order rows stand says nothing.
    mixed = pd.DataFrame(rows).sample(frac=1.0, random_state=0)
    return quantities(mixed, "movement_time")


def known(curves: np.ndarray, phase: int) -> dict[str, np.ndarray]:
    """Return what each person's curve says, in words of the definitions."""
    mine, before = curves[:, phase], curves[:, phase - 1]
    slopes = [stats.linregress(np.arange(PLACES), one).slope for one in mine]
    own = {"slope": np.array(slopes), "gain": mine[:, -1] - mine[:, 0]}
    if phase == 0:
        return own
    return own | {
        "change": mine.mean(axis=1) - before.mean(axis=1),
        "warm-up decrement": mine[:, 0] - before[:, -1],
        "retention": mine[:, -1] - before[:, -1],
    }


@pytest.mark.parametrize("phase", range(PHASES))
def test_each_quantity_is_that_of_the_persons_own_curve(
    curves: np.ndarray, found: pd.DataFrame, phase: int
) -> None:
    own = found[found["phase"] == f"{phase + 1} session"]
    wanted = known(curves, phase)
    assert set(own["quantity"]) == set(wanted)
    for quantity, values in wanted.items():
        mine = own[own["quantity"] == quantity].sort_values("participant")["value"]
        np.testing.assert_allclose(mine, values, rtol=1e-9, atol=1e-9, err_msg=quantity)


def test_a_groups_mean_interval_and_test_are_those_of_its_people(
    curves: np.ndarray, found: pd.DataFrame
) -> None:
    told = summary(found, "movement_time").set_index(["phase", "quantity", "group"])
    people = np.arange(PEOPLE)
    for phase in range(PHASES):
        for quantity, values in known(curves, phase).items():
            for group, who in (("all", people >= 0), ("slow", people % 3 == 0)):
                row = told.loc[(f"{phase + 1} session", quantity, group)]
                test = stats.ttest_1samp(values[who], 0.0)
                low, high = test.confidence_interval(0.95)
                wanted = [values[who].mean(), low, high, test.statistic, test.pvalue]
                mine = row[["mean", "ci_low", "ci_high", "t", "p"]].astype(float)
                np.testing.assert_allclose(mine, wanted, rtol=1e-7, atol=1e-9)
                assert row["n"] == who.sum()
