"""Two time scales of learning, of people whose learning is known."""

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from labcrane.analysis.statistics.time_scales import APART, TAKEN, adjustment, quantities, summary

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
        "difference score": mine[:, 0] - before[:, -1],
        "net gain": mine[:, -1] - before[:, -1],
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
    everybody = {f"P{who:03}": "none" if who % 3 else "slow" for who in range(PEOPLE)}
    told = summary(found, "movement_time", everybody).set_index(["phase", "quantity", "group"])
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


def unbalanced(seed: int) -> pd.DataFrame:
    """Return movements of few people, with pairs in drawn orders, and a fifth of them missing."""
    draw = np.random.default_rng(seed)
    people, pairs = 5, 8
    adds = dict(zip("abcdefgh", draw.uniform(-2.0, 2.0, pairs), strict=True))
    rows = [
        {
            "participant": f"P{person:03}",
            "group": "none",
            "phase": f"{phase} session",
            "place": place,
            "pair": pair,
            "movement_time": 9.0 - 0.4 * place - phase + adds[pair] + draw.normal(0.0, 0.3),
        }
        for person in range(people)
        for phase in (1, 2)
        for place, pair in enumerate(draw.permutation(list(adds)), start=1)
        for _ in range(4)
    ]
    return pd.DataFrame(rows).sample(frac=0.8, random_state=seed)


@pytest.mark.parametrize("seed", range(6))
def test_of_unbalanced_pairs_what_statsmodels_finds_that_they_add_is_taken_away(seed: int) -> None:
    formula = pytest.importorskip("statsmodels.formula.api")
    movements = unbalanced(seed)
    keys = ["participant", "phase", "place", "pair"]
    cells = movements.groupby(keys)["movement_time"].mean().reset_index()
    model = formula.ols("movement_time ~ C(pair, Sum) + participant + phase:C(place)", cells).fit()
    kinds = sorted(cells["pair"].unique())
    adds = {each: model.params[f"C(pair, Sum)[S.{each}]"] for each in kinds[:-1]}
    adds[kinds[-1]] = -sum(adds.values())
    found = adjustment(movements, "movement_time")
    mine = found.shares.to_numpy() @ found.adds
    np.testing.assert_allclose(mine, movements["pair"].map(adds), rtol=1e-9, atol=1e-9)
    wanted = movements["movement_time"] - movements["pair"].map(adds)
    # Means of pairs alone take learning away with them.
    alone = movements.groupby(["participant", "pair"])["movement_time"].mean()
    alone = movements["pair"].map(alone.groupby(level=1).mean())
    assert np.ptp(movements["movement_time"] - alone + alone.mean() - wanted) > 0.05


@pytest.mark.slow
def test_learning_is_found_whole_though_few_people_had_pairs_in_orders_that_favour_it() -> None:
    slopes = []
    for seed in range(30):
        found = quantities(unbalanced(100 + seed), "movement_time")
        slopes.append(found.loc[found["quantity"] == "slope", "value"].mean())
    error = np.std(slopes, ddof=1) / np.sqrt(len(slopes))
    assert error < 0.02
    assert np.mean(slopes) == pytest.approx(-0.4, abs=4.0 * error)


@pytest.mark.parametrize("seed", range(4))
def test_of_one_order_for_all_there_is_only_what_compares_a_pair_with_itself(seed: int) -> None:
    """From session to session pairs are the same: a mean and a last position can be compared."""
    movements = unbalanced(seed)
    same = movements.assign(pair=movements["place"].map(dict(enumerate("abcdefgh", start=1))))
    keys = ["participant", "phase", "place"]
    whole = same.groupby(keys)["movement_time"].mean().unstack(["phase", "place"])
    if whole.isna().any(axis=None):
        same = same[same["participant"].isin(whole.dropna().index)]
    found = quantities(same, "movement_time")
    people = dict.fromkeys(sorted(same["participant"].unique()), "none")
    told = summary(found, "movement_time", people).set_index(["phase", "quantity"])
    first, second = (whole.dropna()[f"{phase} session"] for phase in (1, 2))
    wanted = {"change": second.mean(axis=1) - first.mean(axis=1), "net gain": second[8] - first[8]}
    for quantity, values in wanted.items():
        row = told.loc[("2 session", quantity)]
        assert (row["adjustment"], row["why"], row["n"]) == ("", "", len(values))
        test = stats.ttest_1samp(values, 0.0)
        np.testing.assert_allclose(
            [row["mean"], row["t"], row["p"]], [values.mean(), test.statistic, test.pvalue]
        )
    for key, row in told.iterrows():
        if key[1] not in wanted:
            assert (row["adjustment"], row["why"]) == (APART, APART)
            assert row[["mean", "t", "p"]].isna().all()


def test_a_quantity_says_whether_pairs_were_taken_away_from_it() -> None:
    found = quantities(unbalanced(2), "movement_time")
    assert set(found.loc[found["quantity"] == "slope", "adjustment"]) == {TAKEN}
    one = unbalanced(2).assign(pair="a")
    assert set(quantities(one, "movement_time")["adjustment"]) == {""}
    assert set(quantities(one.drop(columns="pair"), "movement_time")["adjustment"]) == {""}


def test_what_goes_by_a_position_or_phase_that_somebody_lacks_is_not_made_of_its_neighbour() -> (
    None
):
    curves = np.random.default_rng(7).uniform(2.0, 9.0, (PEOPLE, PHASES, PLACES))
    rows = [
        {
            "participant": f"P{person:03}",
            "group": "none",
            "phase": f"{phase + 1} session",
            "place": place + 1,
            "movement_time": curves[person, phase, place],
        }
        for person in range(PEOPLE)
        for phase in range(PHASES)
        for place in range(PLACES)
    ]
    whole = pd.DataFrame(rows)
    who, phase, place = whole["participant"], whole["phase"], whole["place"]
    begins_late = (who == "P001") & (phase == "2 session") & (place == 1)
    ends_early = (who == "P002") & (phase == "1 session") & (place == PLACES)
    stays_away = (who == "P003") & (phase == "2 session")
    found = quantities(whole[~(begins_late | ends_early | stays_away)], "movement_time")
    own = {
        name: {(row.phase[0], row.quantity) for row in part.itertuples()}
        for name, part in found.groupby("participant")
    }
    everything = own["P000"]
    assert len(everything) == 2 + 5 + 5
    assert everything - own["P001"] == {("2", "gain"), ("2", "difference score")}
    assert everything - own["P002"] == {
        ("1", "gain"),
        ("2", "difference score"),
        ("2", "net gain"),
    }
    # Neither is the third session compared with the first.
    away = {(at, name) for at, name in everything if at == "2"}
    away |= {("3", name) for name in ("change", "difference score", "net gain")}
    assert everything - own["P003"] == away
