"""The power of planned tests, against the power that theory gives them."""

from collections.abc import Callable
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.stats import binom, nct, norm, t
from statsmodels.stats.power import TTestIndPower, TTestPower
from statsmodels.stats.proportion import proportion_confint

from labcrane import ProtocolError
from labcrane.analysis.report.figures import power_curve
from labcrane.simulation.power import Claim, Effect, Pool, make_pool, power, read_effect
from labcrane.simulation.sample_size import paragraph, sample_size
from labcrane.simulation.share import share_of
from labcrane.testing import main

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
    return table.assign(outcome="success", practice=0.0)


def groups(difference: float, participants: int = 4000) -> pd.DataFrame:
    random = np.random.default_rng(4)
    label = np.arange(participants) % 2
    return pd.DataFrame(
        {
            "participant": [f"P{p:04}" for p in range(participants)],
            "group": np.array(["none", "visual"])[label],
            "movement_time": 5.0 + difference * label + random.normal(0.0, 1.0, participants),
            "outcome": "success",
            "practice": 0.0,
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
                assert found.power == pytest.approx(0.05, abs=ERROR)


@pytest.mark.parametrize("spread", [0.0, 0.05, 0.4])
def test_an_effect_that_is_put_in_is_found_among_people_who_differ_as_they_did(
    spread: float,
) -> None:
    size = -max(0.03, 0.5 * spread)
    effect = read_effect(f"movement_time~sequence={size}")
    pool = make_pool(within(slope=0.2, spread=spread), effect)
    differ = float((pool.means @ pool.weights).std())
    for found in power(pool, effect, SIZES, COHORTS, seed=3):
        expected = TTestPower().power(-size / differ, found.participants, 0.05)
        assert found.power == pytest.approx(expected, abs=ERROR)
        assert found.null == pytest.approx(0.05, abs=ERROR)


LEAVES = 0.4
"""Share of the participants who leave before the end."""


def with_dropouts(theory: Callable[[int], float], size: int) -> float:
    """Return the power of a cohort of whom each leaves by chance."""
    stay = np.arange(2, size + 1)
    return float(binom.pmf(stay, size, 1.0 - LEAVES) @ [theory(int(count)) for count in stay])


def test_the_power_of_a_cohort_is_that_of_those_of_it_who_stay() -> None:
    movements = within(slope=1.0, spread=2.0, levels=2)
    effect = read_effect("movement_time~half")
    pool = make_pool(movements, effect)
    numbers = pool.means @ pool.weights
    size = float(numbers.mean() / numbers.std())
    leavers = {f"P{p:04}" for p in range(4000) if p % 10 < 10 * LEAVES}
    gone = movements["participant"].isin(leavers) & (movements["half"] == "late")
    ended = movements.assign(outcome=np.where(gone, "ended", "success"))
    for table in (movements[~gone], ended):
        pool = make_pool(table, effect)
        assert set(pool.left_out) == leavers
        theory = partial(TTestPower().power, size, alpha=0.05)
        for found in power(pool, effect, SIZES, COHORTS, seed=6):
            expected = with_dropouts(theory, found.participants)
            assert found.power == pytest.approx(expected, abs=ERROR + 0.01)
            of_all = TTestPower().power(size, found.participants, 0.05)
            assert found.power < of_all - 0.03, "nobody who left is missed"
            assert found.null == pytest.approx(0.05, abs=4.0 * np.sqrt(0.05 * 0.95 / COHORTS))


def of_two_groups(
    shift: float, counts: tuple[int, int], leave: tuple[float, float], claim: Claim
) -> float:
    """Return the power of a t test between groups of whom some leave, by the noncentral t.

    ``shift`` is in standard deviations.
    """
    one, other = (np.arange(2, count + 1)[:, None] for count in counts)
    chance = [
        binom.pmf(n, count, 1.0 - gone)
        for n, count, gone in zip((one, other), counts, leave, strict=True)
    ]
    freedom, error = one + other.T - 2.0, np.sqrt(1.0 / one + 1.0 / other.T)
    if claim.kind == "difference":
        reach = t.isf(0.025, freedom)
        shown = nct.sf(reach, freedom, shift / error) + nct.cdf(-reach, freedom, shift / error)
    else:  # one-sided: the side on which the margin is
        beyond = (claim.margin - shift) * np.sign(claim.margin) / error
        shown = nct.sf(t.isf(0.05, freedom), freedom, beyond)
    return float(chance[0].T[0] @ shown @ chance[1][:, 0])


@pytest.mark.parametrize("number", range(16))
def test_drawn_studies_of_groups_have_the_power_that_the_noncentral_t_gives_them(
    number: int,
) -> None:
    """Two groups of two or three, in either order, of unequal pools, from which people leave."""
    random = np.random.default_rng([441, number])
    names = ["a", "b", "c"][: 2 + number % 2]
    levels = dict(zip(names, random.normal(5.0, 0.6, len(names)), strict=True))
    leave = dict(zip(names, random.uniform(0.0, 0.5, len(names)), strict=True))
    rows, people = [], {}
    for name in names:
        for at in range(int(random.integers(1000, 3000))):
            person = f"{name}{at:04}"
            people[person] = name
            gone = random.random() < leave[name]
            if gone and random.random() < 0.5:
                continue  # left before there was anything to note
            value = levels[name] + random.normal()
            rows.append((person, name, np.nan if gone else value, "ended" if gone else "success"))
    columns = ["participant", "group", "movement_time", "outcome"]
    movements = pd.DataFrame(rows, columns=columns).assign(practice=0.0)
    one, other = random.permutation(names)[:2].tolist()
    put = [None, 0.7, -0.7][number % 3]
    claim = [Claim(), Claim("non_inferiority", 0.5), Claim("non_inferiority", -0.5)][
        number // 2 % 3
    ]
    text = f"movement_time~group[{one},{other}]" + ("" if put is None else f"={put}")
    effect = read_effect(text)
    stayed = movements[movements["outcome"] == "success"].groupby("group")["movement_time"]
    shift = stayed.mean()[other] - stayed.mean()[one] if put is None else put
    gone = {name: 1.0 - stayed.size()[name] / [*people.values()].count(name) for name in names}
    pool = make_pool(movements, effect, people)
    assert len(pool.means) == len(people)
    for found in power(pool, effect, (18, 36), COHORTS, seed=number, claim=claim):
        counts = [(found.participants + names.index(each)) // len(names) for each in (one, other)]
        expected = of_two_groups(shift, tuple(counts), (gone[one], gone[other]), claim)
        assert found.power == pytest.approx(expected, abs=ERROR + 0.02)  # of Welch's test
        assert found.null == pytest.approx(0.05, abs=4.0 * np.sqrt(0.05 * 0.95 / COHORTS) + 0.015)
        assert claim.margin or abs(shift) < 0.3 or found.type_s < 0.1


@pytest.mark.parametrize(("text", "sign"), [("half[early,late]", 1), ("half[late,early]", -1)])
def test_an_effect_is_the_second_level_less_the_first(text: str, sign: int) -> None:
    movements = within(slope=1.0, spread=2.0)
    claim = Claim("non_inferiority", sign * 1.0)
    pool = make_pool(movements, read_effect(f"movement_time~{text}"))
    assert float((pool.means @ pool.weights).mean()) * sign > 0.0
    for put, shown in ((0.0, 0.9), (sign * 2.0, 0.02)):
        effect = read_effect(f"movement_time~{text}={put}")
        (found,) = power(pool, effect, (600,), 400, seed=3, claim=claim)
        assert found.power > shown if put == 0.0 else found.power < shown


def test_two_numbers_may_be_compared_as_two_words() -> None:
    movements = within(slope=1.0, spread=2.0)
    by_numbers = make_pool(movements, read_effect("movement_time~sequence[8,2]"))
    first, second = (
        movements[movements["sequence"] == level]["movement_time"].to_numpy()
        for level in (8.0, 2.0)
    )
    assert by_numbers.means @ by_numbers.weights == pytest.approx(second - first)


def test_a_level_may_have_commas_in_its_name() -> None:
    movements = within(slope=1.0, spread=2.0, participants=20)
    movements["half"] = movements["half"].map({"early": "1 one, a", "late": "2 two, b, c"})
    pool = make_pool(movements, read_effect("movement_time~half[2 two, b, c, 1 one, a]"))
    assert float((pool.means @ pool.weights).mean()) < 0.0


def test_of_every_group_as_many_are_drawn_also_for_effects_within_people() -> None:
    movements = within(slope=1.0, spread=1.0, participants=400)
    group = np.where(movements["participant"] < "P0100", "few", "many")
    steeper = (
        movements["movement_time"] + np.where(group == "few", 6.0, 0.0) * movements["sequence"]
    )
    effect = read_effect("movement_time~sequence=0")
    pool = make_pool(movements.assign(group=group, movement_time=steeper), effect)
    for found in power(pool, effect, (12, 40), COHORTS, seed=5):
        assert found.power < 0.05 + ERROR  # the estimate is of both groups alike
        assert found.power < 0.03, "groups were drawn by chance"


@pytest.mark.parametrize("text", ["log(movement_time)~sequence", "log(movement_time)~half"])
def test_what_has_no_logarithm_is_refused(text: str) -> None:
    movements = within(slope=0.1, spread=0.1, participants=6)
    movements.loc[[3, 17], "movement_time"] = 0.0, -1.0
    with pytest.raises(ProtocolError, match="2 of 48 values are 0 or less, which have no log"):
        make_pool(movements, read_effect(text))


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
    with pytest.raises(ProtocolError, match="is not an effect; write MEASURE~FACTOR"):
        read_effect(text)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("speed~sequence", "movements have no 'speed'; they have participant"),
        ("movement_time~pair", r"'pair' has 3 levels here \(a, b, c\); the test is for"),
        ("movement_time~pair[a,d]", "pair has no level 'd'; it has a, b, c"),
        ("movement_time~pair[b,b]", r"pair\[b,b\] compares 'b' with itself; name two of a, b, c"),
    ],
)
def test_what_cannot_be_tested_is_said(text: str, message: str) -> None:
    movements = within(1.0, 1.0, participants=3, levels=6)
    movements["pair"] = ["a", "b", "c"] * 6
    with pytest.raises(ProtocolError, match=message):
        make_pool(movements, read_effect(text))


def normal_pool(effect: float, participants: int, seed: int) -> Pool:
    """Return differences between two words with a standard deviation of 1."""
    values = np.random.default_rng(seed).normal(effect, 1.0, participants)
    means = np.stack([np.zeros(participants), values], axis=1)
    return Pool(means, np.array([-1.0, 1.0]), None, np.zeros(participants, np.intp), ())


ONE = read_effect("movement_time~half")


def test_the_intervals_of_power_hold_the_power_as_often_as_they_say() -> None:
    size, cohorts, repetitions = 20, 100, 300
    true = TTestPower().power(0.5, size, 0.05)
    inside = 0
    for repetition in range(repetitions):
        pool = normal_pool(0.5, size * cohorts, repetition)
        (found,) = power(pool, ONE, [size], cohorts, seed=1, fresh=True)
        inside += found.power_low <= true <= found.power_high
    assert 0.93 <= inside / repetitions <= 0.97


def pool_of_groups(effect: float, participants: int, seed: int) -> Pool:
    """Return numbers of two groups with a standard deviation of 1."""
    labels = np.arange(participants) % 2
    values = np.random.default_rng(seed).normal(effect * labels, 1.0)
    return Pool(values[:, None], np.ones(1), labels, labels, ())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("make", "participants", "effect"),
    [
        (normal_pool, 150, 0.4),
        (normal_pool, 250, 0.55),
        (normal_pool, 250, 0.65),
        (pool_of_groups, 200, 0.8),
        (pool_of_groups, 300, 1.0),
    ],
)
def test_the_intervals_hold_the_power_where_cohorts_share_the_chance_of_a_pool(
    make: Callable[[float, int, int], Pool], participants: int, effect: float
) -> None:
    size, cohorts, repetitions = 36, 400, 300
    true = (
        TTestPower().power(effect, size, 0.05)
        if make is normal_pool
        else TTestIndPower().power(effect, size / 2, 0.05)
    )
    inside, by_drawing_alone = 0, 0
    for repetition in range(repetitions):
        pool = make(effect, participants, repetition)
        (found,) = power(pool, ONE, [size], cohorts, seed=repetition)
        inside += found.power_low <= true <= found.power_high
        low, high = proportion_confint(round(found.power * cohorts), cohorts, method="wilson")
        by_drawing_alone += low <= true <= high
    # 300 repetitions of an interval that holds 95 % are within 93 to 97 in nine of ten cases.
    assert 0.92 <= inside / repetitions <= 0.98
    assert by_drawing_alone / repetitions < 0.6, "the pool's chance is not what is tried here"


def test_the_far_end_of_a_sample_size_is_open_where_the_pool_is_too_small() -> None:
    found = sample_size(normal_pool(0.5, 30, 5), ONE, 0.8, 500, seed=3)
    assert found.high is None
    text = paragraph("movement_time~half", Claim(), 30, [found])
    assert f"({found.low} to more than {4 * found.participants} by the 95 % interval" in text


def exact(pool: Pool, goal: float) -> int:
    numbers = pool.means @ pool.weights
    size = float(numbers.mean() / numbers.std())
    return next(n for n in range(4, 1000) if TTestPower().power(size, n, 0.05) >= goal)


@pytest.mark.parametrize("cohorts", [7, 9, 20, 100, 1000])
@pytest.mark.parametrize("found", [0, 1])
def test_a_share_of_none_or_all_lies_in_its_interval_and_can_be_drawn(
    cohorts: int, found: int
) -> None:
    share, low, high = share_of(np.full(cohorts, found == 1))
    assert low <= share <= high
    # Wilson's bounds with none, and with all, in closed form.
    quantile = norm.ppf(0.975) ** 2
    far = quantile / (cohorts + quantile)
    assert (low, high) == pytest.approx((1.0 - far, 1.0) if found else (0.0, far), abs=1e-12)
    row = {"power": share, "power_low": low, "power_high": high}
    nothing = {"null": share, "null_low": low, "null_high": high}
    power_curve(pd.DataFrame([{"participants": 36, **row, **nothing}]), "nobody")


@pytest.mark.parametrize("goal", [0.8, 0.9])
def test_the_smallest_cohort_is_that_of_theory(goal: float) -> None:
    pool = normal_pool(0.5, 20000, 5)
    found = sample_size(pool, ONE, goal, 4000, seed=3)
    assert found.low <= found.participants <= found.high
    assert found.low - 1 <= exact(pool, goal) <= found.high + 1
    assert found.high - found.low <= 6


def test_an_effect_that_no_cohort_shows_is_said_so() -> None:
    with pytest.raises(ProtocolError, match="2000 participants have a power of 0"):
        sample_size(normal_pool(0.001, 2000, 5), read_effect("m~half=0.0001"), 0.8, 50, seed=3)


@pytest.mark.slow
def test_small_studies_overstate_what_they_find_and_err_in_its_sign() -> None:
    """Against a simulation of its own: z tests of one normal number."""
    pool = normal_pool(0.2, 40000, 6)
    few, many = power(pool, ONE, [8, 400], 20000, seed=2)
    draws = np.random.default_rng(9).normal(0.2, 1.0, (20000, 8))
    from scipy.stats import ttest_1samp

    seen = draws.mean(axis=1)[ttest_1samp(draws, 0.0, axis=1).pvalue < 0.05]
    true = float((pool.means @ pool.weights).mean())
    assert few.type_m == pytest.approx(np.abs(seen).mean() / 0.2, rel=0.05)
    assert few.type_s == pytest.approx((seen < 0).mean(), abs=0.02)
    assert many.type_m == pytest.approx(1.0, abs=0.05)
    assert many.type_s == 0.0
    assert true == pytest.approx(0.2, abs=0.02)


@pytest.mark.parametrize(
    ("claim", "larger"),
    [(Claim("equivalence", 0.6), 0.0), (Claim("non_inferiority", 0.6), -np.inf)],
)
def test_equivalence_and_non_inferiority_are_shown_as_often_as_statsmodels_shows_them(
    claim: Claim, larger: float
) -> None:
    from statsmodels.stats.weightstats import DescrStatsW

    pool = normal_pool(0.1, 4000, 7)
    (found,) = power(pool, ONE, [24], 300, seed=1, fresh=True, claim=claim)
    drawn = (pool.means @ pool.weights)[: 24 * 166].reshape(166, 24)
    shown = []
    for cohort in drawn:
        stats = DescrStatsW(cohort)
        if claim.kind == "equivalence":
            shown.append(stats.ttost_mean(-0.6, 0.6)[0] < 0.05)
        else:
            shown.append(stats.ttest_mean(0.6, alternative="smaller")[1] < 0.05)
    assert found.cohorts == 166
    assert found.power == np.mean(shown)
    assert found.null == pytest.approx(0.05, abs=4 * np.sqrt(0.05 / 166))


@pytest.mark.parametrize(
    ("kind", "margin", "message"),
    [
        ("difference", 0.3, "a margin of 0.3 is for equivalence or non-inferiority"),
        ("equivalence", 0.0, "equivalence is shown against a margin, and 0 is not one"),
        ("non_inferiority", 0.0, "non_inferiority is shown against a margin, and 0 is not one"),
    ],
)
def test_a_margin_belongs_to_its_claim(kind: str, margin: float, message: str) -> None:
    with pytest.raises(ProtocolError, match=message):
        Claim(kind, margin)


def test_the_paragraph_says_sizes_intervals_and_what_was_tested() -> None:
    found = sample_size(normal_pool(0.5, 4000, 5), ONE, 0.8, 500, seed=3)
    text = paragraph("movement_time~half", Claim(), 4000, [found])
    assert f"For a power of 80 %, {found.participants} participants are needed" in text
    assert f"({found.low} to {found.high} by the 95 % interval, which is of 500 cohorts" in text
    assert "and of the 4000 participants they were drawn from" in text
    assert "movement_time~half was tested" in text
    assert "overstated by a factor of 1." in text
    assert "Participants are counted when they begin; those who drop out are included." in text


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--claim", "equivalent"], "did you mean 'equivalence'?"),
        (["--claim", "equivalence"], "equivalence is shown against a margin"),
        (["--goal", "much"], "--goal 'much' is not a list of powers; write 0.8,0.9"),
    ],
)
def test_what_cannot_be_shown_is_refused_before_anybody_is_simulated(
    tmp_path: Path, words: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["power", "protocol.yaml", "--out", str(tmp_path / "out"), *words]) == 2
    assert message in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "out").exists()
