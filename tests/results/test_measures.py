"""Measures of recorded movements, and gaze."""

import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from labcrane.analysis import Movement, measures_of, with_unseen_areas
from labcrane.analysis.cohort import Cohort
from labcrane.analysis.gaze import Looks, gaze_measures, looks
from labcrane.analysis.measures import MeasureSettings, measure_session
from labcrane.analysis.movements import cut, groups, machine_of
from labcrane.analysis.sticks import reversals
from labcrane.analysis.tables.definitions import MEASURES
from labcrane.testing import make_participant
from labcrane.testing.exporters import MOVEMENT_S


def test_a_minimum_jerk_movement_has_its_closed_forms(tmp_path) -> None:
    table = measures_of(make_participant(tmp_path))
    assert len(table) == 4
    first = table.iloc[0]
    assert first["sub_movements"] == 1
    assert first["limit_hits"] == 0
    assert first["simultaneous"] == pytest.approx(first["bimanual"], abs=0.2)
    _, session = next(make_participant(tmp_path, "P002").sessions())
    movement = next(iter(cut(groups(session), session.trials, 100.0)))
    x, y, _ = movement.tip[0]
    radius = math.hypot(x - machine_of(session).base_x, y)
    # Peak speed of a minimum-jerk movement is 1.875 times its mean speed.
    expected = 1.875 * 0.5 * radius / MOVEMENT_S
    assert first["peak_speed_tip"] == pytest.approx(expected, rel=5e-3)


def test_recorded_results_and_measures_agree(cohort: Cohort) -> None:
    table = measures_of(cohort.included[0])
    np.testing.assert_allclose(table["peak_speed_tip"], table["peak_speed"], rtol=1e-12)
    way = table["path_ratio"]
    assert (way >= 1.0).all()
    np.testing.assert_array_equal(table["absolute_error"], table["error"])
    along = table["constant_error"] - (table["amplitude"] - table["distance"])
    assert np.abs(along).max() <= 0.25 + 1e-9  # the movement began inside the other circle
    assert set(MEASURES) <= set(table)
    assert table["sequence"].tolist() == [1, 1, 2, 2, 3, 3, 4, 4]


def test_settings_change_what_depends_on_them(cohort: Cohort) -> None:
    _, session = next(cohort.included[0].sessions())
    usual = measure_session(session)
    other = measure_session(session, MeasureSettings(dead_zone=0.9, hysteresis=0.5))
    assert (other["axes_used"] < usual["axes_used"]).all()
    assert (other["reversals"] <= usual["reversals"]).all()
    assert other["sparc"].equals(usual["sparc"])


def test_a_movement_without_an_end_has_no_measures_but_its_error(data) -> None:
    from labcrane.analysis import find_cohort

    ended = measures_of(find_cohort(data, ["half-finished"]).included[2]).iloc[-1]
    assert ended["outcome"] == "ended"
    assert math.isnan(ended["sparc"])
    assert math.isnan(ended["path_ratio"])


def test_dwell_and_first_look_are_those_of_the_eyes(cohort: Cohort) -> None:
    """The made-up eyes look at area 1 in the first half of each second."""
    _, session = next(cohort.included[0].sessions())
    seen = looks(session)
    assert seen is not None
    table = measures_of(cohort.included[0])
    for row in table.itertuples():
        assert row.dwell_during_1 == pytest.approx(0.5 * row.movement_time, abs=0.3)
        assert 0.0 <= row.dwell_before_1 <= row.movement_onset + 1e-9
    machine = machine_of(session)
    assert machine.names[0] == "slew"


def test_looks_are_counted_to_the_sample() -> None:
    time = np.arange(0.0, 1.0, 0.1)
    areas = ["", "", "a", "a", "b", "", "a", "", "", ""]
    seen = Looks(time, areas, np.ones(10, bool), ["a", "b"])
    found = gaze_measures(seen, started=0.0, onset=0.5, offset=0.9)
    assert found["dwell_before_a"] == pytest.approx(0.2)
    assert found["dwell_during_a"] == pytest.approx(0.1)
    assert found["look_lead_a"] == pytest.approx(0.3)
    assert found["look_lead_b"] == pytest.approx(0.1)


def test_a_sample_alone_is_no_first_look_and_neither_are_two_beside_a_gap() -> None:
    time = np.arange(0.0, 1.0, 0.02)
    areas = np.full(50, "", dtype=object)
    areas[5] = "a"  # a sample alone, of 20 ms
    areas[10:13] = "a"  # 60 ms
    areas[20:24] = "a"  # 80 ms
    seen = Looks(time, areas.tolist(), np.ones(50, bool), ["a"])
    assert seen.first("a", 0.0, 1.0) == pytest.approx(0.1)
    assert seen.first("a", 0.0, 1.0, 0.06) == pytest.approx(0.2)
    assert seen.first("a", 0.0, 1.0, 0.066) == pytest.approx(0.4)
    assert math.isnan(seen.first("a", 0.0, 1.0, 0.1))
    assert seen.first("a", 0.41, 1.0, 0.05) == pytest.approx(0.41)
    found = gaze_measures(seen, 0.0, 0.9, 0.98)
    assert found["look_lead_a"] == pytest.approx(0.9 - 0.4)
    late = np.where(np.arange(50) >= 22, time + 0.3, time)
    torn = Looks(late, areas.tolist(), np.ones(50, bool), ["a"])
    assert math.isnan(torn.first("a", 0.0, 1.3, 0.07))


def test_a_gap_in_the_eyes_is_no_look() -> None:
    seen = Looks(np.array([0.0, 0.1, 0.2, 5.0, 5.1]), ["a"] * 5, np.ones(5, bool), ["a"])
    assert seen.dwell("a", [(0.0, 10.0)]) == pytest.approx(0.1 + 0.1 + 0.2 + 0.1 + 0.1)
    assert math.isnan(seen.first("b", 0.0, 10.0))


def test_an_area_nobody_looked_at_has_0_s_but_where_tracking_was_lost() -> None:
    random = np.random.default_rng(38)
    time = np.arange(0.0, 10.0, 0.01)
    for _ in range(50):
        areas = random.choice(["", "a"], len(time)).tolist()
        lost, back = np.sort(random.uniform(0.0, 10.0, 2))
        tracked = (time < lost) | (time >= back)
        areas = [area if on else "" for area, on in zip(areas, tracked, strict=True)]
        seen = Looks(time, areas, tracked, ["a", "b"])
        found = gaze_measures(seen, 0.0, 4.0, 9.0)
        for part, start, stop in (("before", 0.0, 4.0), ("during", 4.0, 9.0)):
            inside = (time >= start) & (time < stop)
            share = tracked[inside].mean()
            assert found[f"gaze_valid_{part}"] == pytest.approx(share, abs=0.01)
            looked = 0.01 * (np.array(areas)[inside] == "a").sum()
            if share == 0.0:
                assert math.isnan(found[f"dwell_{part}_a"])
                assert math.isnan(found[f"dwell_{part}_b"])
            elif share > 0.01:
                assert found[f"dwell_{part}_a"] == pytest.approx(looked, abs=0.02)
                assert found[f"dwell_{part}_b"] == 0.0
    nothing = gaze_measures(Looks(time, [""] * 1000, time > 4.0, ["a"]), 0.0, 4.0, 9.0)
    assert math.isnan(nothing["dwell_before_a"])
    assert nothing["dwell_during_a"] == 0.0


def test_an_area_that_only_others_looked_at_has_0_s_and_does_not_raise_their_mean() -> None:
    rows = [
        {"gaze_valid_before": 1.0, "gaze_valid_during": 0.9, "dwell_during_a": 1.0},
        {"gaze_valid_before": 1.0, "gaze_valid_during": 0.0},
        {"gaze_valid_before": 1.0, "gaze_valid_during": 0.5, "look_lead_a": np.nan},
        {"gaze_valid_before": np.nan, "gaze_valid_during": np.nan},
    ]
    found = with_unseen_areas(pd.DataFrame(rows))
    np.testing.assert_array_equal(found["dwell_during_a"], [1.0, np.nan, 0.0, np.nan])
    assert found["dwell_during_a"].mean() == 0.5
    assert found["look_lead_a"].isna().all()
    assert with_unseen_areas(pd.DataFrame({"dwell_during_a": [np.nan]})).isna().all(axis=None)


def test_a_pause_is_no_time_of_gaze_wherever_it_comes() -> None:
    """The eyes see the same as without it, and anything at all while it lasts."""
    random = np.random.default_rng(381)
    own = np.arange(0.0, 10.0, 0.01)
    for _ in range(50):
        onset, offset = np.sort(random.choice(own[100:-100], 2, replace=False))
        areas = np.repeat(random.choice(["", "a", "b"], 100), 10)
        tracked = np.repeat(random.random(50) > 0.3, 20)
        areas[~tracked] = ""
        whole = gaze_measures(
            Looks(own, areas.tolist(), tracked, ["a", "b"]), 0.0, onset, offset, 0.0
        )
        number = int(random.integers(1, 4))
        began = np.sort(random.choice(own[20:-20:50], number, replace=False))
        lasted = random.uniform(1.0, 60.0, number)
        later = (lasted[:, None] * (own >= began[:, None] - 1e-9)).sum(axis=0)
        starts = began + np.concatenate([[0.0], np.cumsum(lasted)[:-1]])
        pauses = list(zip(starts.tolist(), (starts + lasted).tolist(), strict=True))
        meanwhile = np.concatenate([np.arange(a + 0.005, b, 0.01) for a, b in pauses])
        time = np.concatenate([own + later, meanwhile])
        order = np.argsort(time)
        names = np.concatenate([areas, np.full(len(meanwhile), "a")])[order].tolist()
        known = np.concatenate([tracked, np.ones(len(meanwhile), bool)])[order]
        at = [float(each + later[np.searchsorted(own, each - 1e-9)]) for each in (onset, offset)]
        found = gaze_measures(
            Looks(time[order], names, known, ["a", "b"]), 0.0, at[0], at[1], 0.0, pauses
        )
        for name, value in whole.items():
            assert found[name] == pytest.approx(value, abs=0.03, nan_ok=True), name


def test_a_movement_knows_its_pauses_by_the_clock_of_the_trial_that_stood_still() -> None:
    elapsed = np.arange(0.0, 1.0, 0.01)
    due = 5.0 + elapsed + np.where(elapsed > 0.305, 20.0, 0.0) + np.where(elapsed > 0.705, 1.0, 0.0)
    nothing = np.zeros((100, 3))
    movement = Movement({}, 100.0, due, elapsed, nothing, nothing, {}, nothing, nothing)
    np.testing.assert_allclose(movement.pauses, [(5.31, 25.31), (25.71, 26.71)])
    assert replace(movement, due=5.0 + elapsed).pauses == []


def turns_one_by_one(axis: list[float], hysteresis: float) -> int:
    """Count turning points that are more than a hysteresis apart, a sample at a time."""
    count, direction = 0, 0
    lowest = highest = axis[0]
    for value in axis:
        lowest, highest = min(lowest, value), max(highest, value)
        if direction <= 0 and value - lowest > hysteresis:
            count += direction < 0
            direction, highest = 1, value
        elif direction >= 0 and highest - value > hysteresis:
            count += direction > 0
            direction, lowest = -1, value
    return count


def test_reversals_are_those_that_are_counted_sample_by_sample() -> None:
    random = np.random.default_rng(1)
    for trial in range(400):
        steps = random.normal(size=random.integers(1, 300)) * random.choice([1e-200, 0.05, 0.3])
        kinds = (steps, np.cumsum(steps), np.round(np.cumsum(steps), 1), np.maximum(steps, 0.0))
        hysteresis = float(random.choice([0.0, 0.02, 0.1, 0.3]))
        for axis in kinds:
            assert reversals(axis, hysteresis) == turns_one_by_one(axis.tolist(), hysteresis), trial
