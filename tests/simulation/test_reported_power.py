"""Power of the report's own tests, against theory and against the tests themselves."""

from collections.abc import Iterator
from itertools import combinations
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.stats import f_oneway, ttest_1samp, ttest_ind
from simple_crane import CRANE
from statsmodels.formula.api import ols
from statsmodels.stats.multitest import multipletests
from statsmodels.stats.power import TTestIndPower

from labcrane import ProtocolError
from labcrane.analysis import find_cohort, measures_of
from labcrane.simulation.power import Claim, read_effect
from labcrane.simulation.reported import (
    Drawer,
    PlannedTest,
    ask,
    plan_test,
    power_of_report,
)
from labcrane.simulation.simulation import (
    SimulationJob,
    simulate_study,
    simulate_tables,
    simulate_trials,
)
from labcrane.testing import main

COHORTS = 15
"""Where each cohort is compared by itself, so that few will do."""


def movements(
    people: int = 60,
    groups: tuple[str, ...] = ("none", "visual"),
    difference: float = 0.0,
    slope: float = 0.0,
    sessions: int = 1,
    seed: int = 1,
) -> pd.DataFrame:
    """Return movements of 8 pairs: standard deviations of 1 over people, and of 1 within them."""
    random = np.random.default_rng(seed)
    rows = []
    for person in range(people):
        group = groups[person % len(groups)]
        own = random.normal() + difference * (group == groups[-1])
        for session in range(1, sessions + 1):
            for at, pair in enumerate(random.permutation(8).tolist()):
                distance = float(2 + pair % 4)
                value = 10.0 + own + slope * (at - 3.5) + random.normal()
                rows.append(
                    (f"P{person:03}", session, group, float(at + 1), f"{pair}", distance,
                     distance, "left" if pair < 4 else "right", value)
                )  # fmt: skip
    columns = ["participant", "session", "group", "sequence", "pair", "distance", "difficulty",
               "far_side", "movement_time"]  # fmt: skip
    table = pd.DataFrame(rows, columns=columns)
    return table.assign(
        session_name=table["session"].map("session {}".format),
        block=1.0, block_name="aiming", practice=0.0, outcome="success",
    )  # fmt: skip


NOTHING = Claim()
ALIKE = Claim("equivalence", 0.5)
PLAIN = read_effect("movement_time~group")
OF_GROUPS = read_effect("movement_time~group[none,visual]")


def drawn(
    planned: PlannedTest, size: int, seed: int
) -> Iterator[tuple[pd.DataFrame, pd.DataFrame]]:
    """Yield each cohort that is tested, and the same with nothing in it."""
    drawer = Drawer(planned)
    for number in range(COHORTS):
        random = np.random.default_rng([seed, size, number])
        cohort = drawer.cohort(drawer.draw(size, random))
        yield cohort, drawer.permuted(cohort, random)


def in_groups(cohort: pd.DataFrame) -> tuple[np.ndarray, np.ndarray]:
    """Return participants' means of either group."""
    means = cohort.groupby(["group", "participant"])["movement_time"].mean()
    return means["none"].to_numpy(), means["visual"].to_numpy()


def test_a_contrast_of_groups_finds_what_scipys_t_test_finds_in_each_cohort() -> None:
    planned = plan_test("contrast", OF_GROUPS, movements(difference=0.7), NOTHING)
    (found,) = power_of_report(planned, [24], COHORTS, seed=3)
    cohorts = list(drawn(planned, 24, seed=3))
    assert all(len(one) == len(two) == 12 for one, two in (in_groups(each) for each, _ in cohorts))
    tests = [ttest_ind(*in_groups(plain)) for plain, _ in cohorts]
    assert found.power == np.mean([test.pvalue < 0.05 for test in tests])
    assert found.null == np.mean(
        [ttest_ind(*in_groups(empty)).pvalue < 0.05 for _, empty in cohorts]
    )
    assert 0.2 < found.power < 1.0
    assert found.null < 0.2
    one, other = in_groups(planned.results)
    seen = [np.diff([each.mean() for each in in_groups(plain)])[0] for plain, _ in cohorts]
    shown = np.abs([each for each, test in zip(seen, tests, strict=True) if test.pvalue < 0.05])
    assert found.type_m == pytest.approx(shown.mean() / (other.mean() - one.mean()))


@pytest.mark.soak
@pytest.mark.timeout(1800)
def test_the_intervals_of_the_reports_tests_hold_the_power_as_often_as_they_say() -> None:
    repetitions, inside = 300, 0
    # Means of 8 movements: a standard deviation of 1 over people, and of 1/8 of it within them.
    size = 0.9 / np.sqrt(1.0 + 1.0 / 8.0)
    true = TTestIndPower().power(size, 12, 0.05)
    for repetition in range(repetitions):
        table = movements(people=120, difference=0.9, seed=repetition)
        planned = plan_test("contrast", OF_GROUPS, table, NOTHING)
        (found,) = power_of_report(planned, [24], 40, seed=repetition)
        inside += found.power_low <= true <= found.power_high
    # So few cohorts cannot tell the pool's chance from the drawing's: they claim a little less.
    assert 0.92 <= inside / repetitions <= 0.99


@pytest.mark.parametrize("there", [0.0, 2.0])
def test_what_is_put_in_takes_the_place_of_what_two_groups_differ_by(there: float) -> None:
    put = read_effect("movement_time~group[none,visual]=0.9")
    planned = plan_test("contrast", put, movements(difference=there), NOTHING)
    (found,) = power_of_report(planned, [24], COHORTS, seed=6)
    one, other = (each.mean() for each in in_groups(planned.results))
    groups = [in_groups(plain) for plain, _ in drawn(planned, 24, seed=6)]
    by = 0.9 - (other - one)
    expected = np.mean([ttest_ind(one, other + by).pvalue < 0.05 for one, other in groups])
    assert found.power == expected
    assert 0.2 < expected < 1.0


@pytest.mark.slow
def test_what_is_put_in_is_corrected_with_the_other_contrasts() -> None:
    """Of three groups, by a linear model of participants' means and Holm's correction."""
    table = movements(120, groups=("a", "b", "c"), difference=0.6)
    planned = plan_test("contrast", read_effect("movement_time~group[a,c]=1.1"), table, NOTHING)
    (found,) = power_of_report(planned, [30], COHORTS, seed=8)
    whole = table.groupby(["group", "participant"])["movement_time"].mean().groupby("group").mean()
    corrected, plain = [], []
    for cohort, _ in drawn(planned, 30, seed=8):
        means = cohort.groupby(["group", "participant"])["movement_time"].mean().reset_index()
        means.loc[means["group"] == "c", "movement_time"] += 1.1 - (whole["c"] - whole["a"])
        model = ols("movement_time ~ 0 + group", means).fit()
        pairs = model.t_test(np.array([[1, 0, -1], [1, -1, 0], [0, 1, -1]])).pvalue
        corrected.append(multipletests(pairs, method="holm")[1][0] < 0.05)
        plain.append(pairs[0] < 0.05)
    assert found.power == np.mean(corrected)
    assert np.mean(corrected) < np.mean(plain), "the draw shows no correction"


@pytest.mark.slow
@pytest.mark.parametrize("text", ["group[T.visual]", "sequence", "group[T.visual]:sequence"])
def test_what_is_put_in_changes_a_term_of_the_mixed_model_as_if_everybody_had_it(
    text: str,
) -> None:
    table = movements(24, difference=2.0, slope=-0.2)
    size = {"group[T.visual]": 0.1, "sequence": 0.01, "group[T.visual]:sequence": 0.02}[text]
    planned = plan_test("mixed", read_effect(f"movement_time~{text}={size}"), table, NOTHING)
    answer = ask(planned, planned.results)
    random = np.random.default_rng([4, 24, 0])
    drawer = Drawer(planned)
    cohort = drawer.cohort(drawer.draw(24, random))
    step = np.ones(len(cohort))
    if "group" in text:
        step *= cohort["group"] == "visual"
    if "sequence" in text:
        step *= cohort["place"] - cohort["place"].mean()
    by = size - answer.estimate
    moved = cohort.assign(movement_time=cohort["movement_time"] * np.exp(by * step))
    (found,) = power_of_report(planned, [24], 1, seed=4)
    expected, said = ask(planned, moved), ask(planned, cohort).moved(by)
    assert said.estimate == pytest.approx(expected.estimate, abs=1e-4)
    assert said.error == pytest.approx(expected.error, rel=1e-2)
    assert found.power == float(expected.p < 0.05)


@pytest.mark.slow
@pytest.mark.parametrize("cohorts", [6, pytest.param(20, marks=pytest.mark.long)])
@pytest.mark.parametrize(
    ("size", "claim", "lowest", "most"),
    [("", NOTHING, 0.8, 1.0), ("=0.0001", NOTHING, 0.0, 0.25), ("=0.0001", ALIKE, 0.8, 1.0)],
)
def test_where_a_mixed_model_has_nothing_to_find_groups_that_differ_are_no_matter(
    size: str, claim: Claim, lowest: float, most: float, cohorts: int
) -> None:
    effect = read_effect(f"movement_time~group[T.visual]{size}")
    planned = plan_test("mixed", effect, movements(60, difference=2.5), claim)
    (found,) = power_of_report(planned, [16], cohorts, seed=1, claim=claim)
    assert lowest <= found.power <= most
    assert found.null <= 0.25


@pytest.mark.slow
@pytest.mark.parametrize(("slope", "put"), [(-0.08, None), (-0.3, 0.09)])
def test_the_reports_trend_finds_what_a_t_test_of_slopes_finds_in_each_cohort(
    slope: float, put: float | None
) -> None:
    """What is put in changes it as if everybody had it."""
    effect = read_effect("movement_time~sequence" + ("" if put is None else f"={put}"))
    planned = plan_test("trend", effect, movements(groups=("",), slope=slope), NOTHING)
    (found,) = power_of_report(planned, [16], COHORTS, seed=5)
    by = 0.0 if put is None else put - ask(planned, planned.results).estimate
    shown = []
    for cohort, _ in drawn(planned, 16, seed=5):
        values = cohort["movement_time"].to_numpy().reshape(16, 8) + by * np.arange(8.0)
        slopes = np.polyfit(np.arange(8.0), values.T, 1)[0]
        shown.append(ttest_1samp(slopes, 0.0).pvalue < 0.05)
    assert found.power == np.mean(shown)
    assert 0.2 < found.power < 1.0


def test_equivalence_is_shown_as_often_as_two_one_sided_tests_show_it() -> None:
    from statsmodels.stats.weightstats import CompareMeans, DescrStatsW

    claim = Claim("equivalence", 1.0)
    planned = plan_test("contrast", OF_GROUPS, movements(), claim)
    (found,) = power_of_report(planned, [30], COHORTS, seed=7, claim=claim)
    shown = []
    for cohort, _ in drawn(planned, 30, seed=7):
        one, other = in_groups(cohort)
        both = CompareMeans(DescrStatsW(other), DescrStatsW(one))
        shown.append(both.ttost_ind(-1.0, 1.0)[0] < 0.05)
    assert found.power == np.mean(shown)
    assert 0.2 < found.power < 1.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "text"),
    [
        ("anova", "movement_time~group:sequence"),
        ("anova", "movement_time~session"),
        ("anova", "movement_time~distance"),
        ("contrast", "movement_time~distance[2,5]"),
        ("contrast", "movement_time~session[1 session 1,2 session 2]"),
        ("mixed", "movement_time~sequence"),
        ("mixed", "movement_time~group[T.visual]"),
    ],
)
def test_the_planned_test_is_the_one_that_the_report_prints(kind: str, text: str) -> None:
    """Of everybody: the p of the report's own table."""
    from results import tested

    from labcrane.analysis.report.factors import factors_of, with_factors
    from labcrane.analysis.statistics.mixed import mixed_model

    table = movements(24, sessions=2, difference=0.5, slope=-0.1)
    effect = read_effect(text)
    planned = plan_test(kind, effect, table, NOTHING)
    answer = ask(planned, planned.results)
    whole = with_factors(table)
    factors = factors_of(whole)
    if kind == "anova":
        rows = tested.anova_table(whole, factors)
        expected = rows.loc[rows["factor"] == effect.factor, "p_gg"].item()
    elif kind == "contrast":
        rows = tested.contrast_table(whole, factors)
        own = rows[(rows["factor"] == effect.factor) & (rows["at"] == "")]
        pair = own[(own["first"] == effect.between[0]) & (own["second"] == effect.between[1])]
        expected = pair["p_holm"].item()
        assert answer.estimate == pytest.approx(-pair["difference"].item())
    else:
        terms = mixed_model(whole.assign(sequence=whole["place"]), "movement_time").terms
        expected = terms.loc[terms["term"] == effect.factor, "p"].item()
    assert answer.p == pytest.approx(expected, rel=1e-9)


@pytest.mark.slow
def test_who_drops_out_is_left_out_by_the_f_test_and_kept_by_the_mixed_model() -> None:
    table = movements(30, sessions=2, slope=-0.3)
    gone = table["participant"].isin([f"P{n:03}" for n in range(12)]) & (table["session"] == 2)
    left = table[~gone].reset_index(drop=True)
    sequence = read_effect("movement_time~sequence")
    anova = plan_test("anova", sequence, left, NOTHING)
    whole = plan_test("anova", sequence, table, NOTHING)
    assert ask(anova, anova.results).p != ask(whole, whole.results).p
    assert anova.results["participant"].nunique() == 30
    (found,) = power_of_report(plan_test("mixed", sequence, left, NOTHING), [10], 6, seed=2)
    assert found.power > 0.5


@pytest.mark.slow
@pytest.mark.parametrize("number", range(2))
def test_the_f_test_of_drawn_groups_finds_what_scipys_finds_in_each_cohort(number: int) -> None:
    """Three or four groups of unequal pools, of whom some leave at once and some in a movement."""
    random = np.random.default_rng([441, number])
    groups = ("a", "b", "c", "d")[: 3 + number % 2]
    table = movements(90, groups=groups, difference=float(random.uniform(0.4, 0.9)), seed=number)
    of = dict(table.groupby("participant")["group"].first())
    smaller = {who for who, group in of.items() if group == "b" and random.random() < 0.4}
    people = {who: group for who, group in of.items() if who not in smaller}
    gone = {who: random.random() for who in people if random.random() < 0.3}
    at_once = {who for who, chance in gone.items() if chance < 0.5} | smaller
    left = table[~table["participant"].isin(at_once)]
    left = left.assign(outcome=np.where(left["participant"].isin(gone), "ended", "success"))
    for kind, text in (("anova", "movement_time~group"), ("contrast", "movement_time~group[c,b]")):
        planned = plan_test(kind, read_effect(text), left, NOTHING, people)
        assert dict(planned.people) == people
        (found,) = power_of_report(planned, [24], COHORTS, seed=number)
        shown, tested = [], []
        for cohort, _ in drawn(planned, 24, seed=number):
            means = cohort.groupby(["group", "participant"])["movement_time"].mean()
            own = [part.to_numpy() for _, part in means.groupby("group")]
            tested.append(len(means))
            if kind == "anova":
                shown.append(f_oneway(*own).pvalue < 0.05)
                continue
            model = ols("movement_time ~ 0 + group", means.reset_index()).fit()
            pairs = np.array(
                [
                    np.eye(len(own))[i] - np.eye(len(own))[j]
                    for i, j in combinations(range(len(own)), 2)
                ]
            )
            asked = [(i, j) for i, j in combinations(range(len(own)), 2)].index((1, 2))
            p = multipletests(model.t_test(pairs).pvalue, method="holm")[1][asked]
            shown.append(p < 0.05)
        assert found.power == np.mean(shown)
        share = 1.0 - len(gone) / len(people)
        assert np.mean(tested) == pytest.approx(24 * share, abs=2.0)


@pytest.mark.slow
def test_a_cohort_of_people_without_results_shows_nothing() -> None:
    table = movements(30)
    for kind, effect in (("contrast", OF_GROUPS), ("anova", PLAIN), ("mixed", "group[T.visual]")):
        asked = effect if kind != "mixed" else read_effect(f"movement_time~{effect}")
        planned = plan_test(kind, asked, table, NOTHING)
        for few in (0, 1, 2):
            people = planned.results["participant"].isin([f"P{n:03}" for n in range(few)])
            assert np.isnan(ask(planned, planned.results[people]).p)


def test_time_outs_are_no_results_and_their_places_still_are_places() -> None:
    table = movements(20, slope=-0.3)
    table.loc[table["sequence"] == 1.0, "outcome"] = "timeout"
    planned = plan_test("trend", read_effect("movement_time~sequence"), table, NOTHING)
    assert planned.results["place"].min() == 2.0
    assert len(planned.results) == 20 * 7


@pytest.mark.slow
def test_cohorts_are_the_same_whoever_makes_them() -> None:
    planned = plan_test("contrast", OF_GROUPS, movements(40, difference=0.5), NOTHING)
    one = next(power_of_report(planned, [12], 30, seed=9))
    two = next(power_of_report(planned, [12], 30, seed=9, workers=2))
    assert one == two


@pytest.mark.parametrize(
    ("kind", "text", "claim", "message"),
    [
        (
            "anova",
            "movement_time~nothing",
            NOTHING,
            "no anova test of movement_time over 'nothing'",
        ),
        ("anova", "movement_time~group=0.2", NOTHING, "an F test has no direction"),
        ("anova", "movement_time~group", Claim("equivalence", 0.1), "an F test has no direction"),
        ("contrast", "movement_time~group", NOTHING, "write movement_time~group[ONE,OTHER]"),
        ("contrast", "movement_time~group[none,loud]", NOTHING, "no level 'loud'; it has none, v"),
        (
            "anova",
            "movement_time~group[none,visual]",
            NOTHING,
            "--test anova tests all levels, and [none,visual] are two; write",
        ),
        (
            "trend",
            "movement_time~sequence[1,2]",
            NOTHING,
            "--test trend tests all levels, and [1,2] are two; write",
        ),
        (
            "contrast",
            "movement_time~group[visual,visual]",
            NOTHING,
            "compares 'visual' with itself",
        ),
        ("trend", "movement_time~distance", NOTHING, "trend is over the sequence of one session"),
        (
            "mixed",
            "log(movement_time)~group",
            NOTHING,
            "its mixed model takes logarithms of times by itself",
        ),
        ("mixed", "speed~group", NOTHING, "movements have no 'speed'"),
    ],
)
def test_what_the_report_does_not_test_is_refused(
    kind: str, text: str, claim: Claim, message: str
) -> None:
    with pytest.raises(ProtocolError) as caught:
        plan_test(kind, read_effect(text), movements(12), claim)
    assert message in str(caught.value)


STUDY = (
    """\
labcrane: 1
study: planned
title: Few movements
participants: {pattern: 'P\\d{3}', planned: 6}
rate_hz: 60
"""
    + CRANE
    + """\
tasks:
  aiming: {use: aiming, distances: [2, 4], movements: 2, limit_s: 14}
design:
  groups: {none: [], slow: []}
  order: {pairs: shuffled}
sessions:
  - {name: one, steps: [{block: {task: aiming, pairs: 3}}]}
  - {name: two, steps: [{block: {task: aiming, pairs: 2}}]}
"""
)
COHORT = """\
labcrane_cohort: 1
operator: {reaction_s: {lowest: 0.3, highest: 0.5}}
groups: {slow: {fitts_b_s: 1.2}}
dropout: 0.2
"""


@pytest.fixture
def study(tmp_path: Path) -> Path:
    path = tmp_path / "study" / "protocol.yaml"
    path.parent.mkdir()
    path.write_text(STUDY)
    path.with_name("cohort.yaml").write_text(COHORT)
    return path


@pytest.mark.slow
def test_trial_tables_without_files_are_those_of_the_participant_files(
    study: Path, tmp_path: Path
) -> None:
    cohort = study.with_name("cohort.yaml")
    names = [f"P{number:03}" for number in range(1, 7)]
    files = [SimulationJob(study, cohort, tmp_path / "files", name) for name in names]
    tables = [SimulationJob(study, cohort, tmp_path / "tables", name) for name in names]
    list(simulate_study(files))
    made = dict(zip(names, simulate_tables(tables), strict=True))
    people = find_cohort(tmp_path / "files", ["simulated", "half-finished"]).included
    assert len(people) == len(names)
    for person in people:
        whole = measures_of(person)
        own = made[person.name.removesuffix("-SIMULATED")]
        assert len(own) == len(whole)
        pd.testing.assert_frame_equal(
            own[sorted(own)], whole[sorted(own)], check_dtype=False, check_exact=True
        )
    assert not list((tmp_path / "tables").rglob("*.h5"))
    assert not list((tmp_path / "tables").rglob("*.xdf"))
    again = simulate_trials(tables[0])  # as it was read back
    pd.testing.assert_frame_equal(again, made["P001"])


@pytest.mark.slow
def test_power_makes_files_only_for_what_is_measured_in_frames(
    study: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["power", str(study), "--participants", "4", "--pool", "6", "--cohorts", "20"]
    where = tmp_path / "by_trials"
    assert main([*words, "--out", str(where), "--effect", "movement_time~group"]) == 0
    assert not list(where.rglob("*.h5"))
    assert len(list((where / "pool").glob("*_trials.parquet"))) == 6
    again = [*words, "--out", str(where), "--effect", "movement_time~group[none,slow]"]
    before = {path: path.stat().st_mtime_ns for path in (where / "pool").glob("*.parquet")}
    assert main([*again, "--test", "contrast", "--goal", "0.6"]) in {0, 2}
    assert {path: path.stat().st_mtime_ns for path in before} == before  # nobody made again
    where = tmp_path / "by_frames"
    assert main([*words, "--out", str(where), "--effect", "path_ratio~group"]) == 0
    assert len(list(where.rglob("*.h5"))) == 6
    recorded = ["--recordings", str(where / "pool"), "--include", "simulated"]
    where = tmp_path / "drawn"
    found = ["--test", "contrast", "--effect", "movement_time~group[none,slow]=2"]
    capsys.readouterr()
    assert main([*words, "--out", str(where), *recorded, *found]) == 0
    assert "DRAWN FROM RECORDINGS" in capsys.readouterr().out
    assert not (where / "pool").exists()
    assert len(pd.read_csv(where / "power.csv")) == 1


@pytest.mark.slow
def test_who_leaves_before_a_first_movement_is_named_and_drawn(
    study: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    study.with_name("cohort.yaml").write_text("labcrane_cohort: 1\ndropout: 0.7\n")
    where = tmp_path / "out"
    effect = ["--effect", "movement_time~group[none,slow]", "--goal", "0.06"]
    words = ["--participants", "6", "--pool", "14", "--cohorts", "20", "--out", str(where), *effect]
    main(["power", str(study), *words])
    said = " ".join(capsys.readouterr().out.split())
    tables = {
        path.name.partition("_")[0]: pd.read_parquet(path) for path in where.rglob("*.parquet")
    }
    gone = sorted(name for name, table in tables.items() if table.empty)
    assert 0 < len(gone) < 14
    assert f"without a counted movement: {', '.join(gone)}; they are sampled like the" in said
    assert "14 participants were simulated" in (where / "sample_size.md").read_text()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--test", "anvoa"], "--test 'anvoa' is not a test; did you mean 'anova'?"),
        (
            ["--test", "anova", "--resimulate", "3"],
            "--resimulate is for the t test of new participants",
        ),
        (["--recordings", "nowhere"], "there is no data folder nowhere"),
    ],
)
def test_what_cannot_be_tested_is_refused_before_anybody_is_simulated(
    study: Path, tmp_path: Path, words: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["power", str(study), "--out", str(tmp_path / "out"), *words]) != 0
    assert message in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "out").exists()
