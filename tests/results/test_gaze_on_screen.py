"""Gaze joined to the picture that was on the glass, and its drift from a fixation target."""

import math
from pathlib import Path

import numpy as np
import pytest

from labcrane import open_recording
from labcrane.analysis.gaze import Looks, drift, looks, looks_on_screen
from labcrane.analysis.measures import MeasureSettings, measure_session
from results.recorded import record, study

DELAY_S = 0.0437
RATE_HZ = 120.0
SIZE = 60.0


def a_trial(seed: int) -> tuple[np.ndarray, dict[str, np.ndarray], np.ndarray, np.ndarray, list]:
    """Return pictures, areas and gaze of somebody who follows one of two moving things, then both.

    The eye follows the light: what it sees is the picture that was handed over 43.7 ms ago.
    """
    random = np.random.default_rng(seed)
    shown = 5.0 + np.arange(1200) / 60.0 + random.uniform(0.0, 0.004, 1200)
    phase = random.uniform(0.0, 2 * math.pi, 2)
    x = 900.0 + 500.0 * np.sin(1.1 * shown + phase[0])
    y = 500.0 + 250.0 * np.sin(0.7 * shown + phase[1])
    centres = {"tip": np.stack([x, y], 1), "ball": np.stack([x + SIZE + 20.0, y], 1)}
    areas = {name: np.hstack([at - SIZE / 2, at + SIZE / 2]) for name, at in centres.items()}
    time = np.arange(shown[0] + 0.1, shown[-1], 1.0 / RATE_HZ)
    names = ["tip" if int(each / 1.5) % 2 else "ball" for each in time]
    gaze = np.zeros((len(time), 2))
    for number, (now, name) in enumerate(zip(time, names, strict=True)):
        lit = [k for k, flip in enumerate(shown[:]) if flip <= now - DELAY_S][-1]
        gaze[number] = centres[name][lit] + random.normal(0.0, 8.0, 2)
    return shown, areas, time, gaze, names


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_gaze_that_follows_the_light_is_on_the_object_that_was_shown(seed: int) -> None:
    shown, areas, time, gaze, names = a_trial(seed)

    def right(delay_s: float) -> float:
        found = looks_on_screen(time, gaze, shown, areas, delay_s).area
        return float(np.mean([one == other for one, other in zip(found, names, strict=True)]))

    assert right(DELAY_S) >= 0.99
    assert right(0.0) < 0.95  # the delay matters: without it this test would prove nothing


@pytest.mark.slow
@pytest.mark.parametrize(("cameras", "area"), [(["cab"], "target"), (["cab", "top"], "top_target")])
def test_eyes_that_look_into_the_window_are_measured_as_eyes_that_name_what_they_look_at(
    tmp_path: Path, cameras: list[str], area: str
) -> None:
    """In the window the target is within the area of the tip, and the smaller one counts."""
    tables = []
    for name, gaze in (("named", True), ("seen", cameras)):
        path = record(study(tmp_path / name), tmp_path / name / "data", "P001", gaze=gaze)
        tables.append(measure_session(open_recording(path).session(1)))
    named, seen = tables
    assert (named["dwell_during_1"] > 0.2).any()
    for measure in ("dwell_before", "dwell_during", "look_lead"):
        np.testing.assert_array_equal(seen[f"{measure}_{area}"], named[f"{measure}_1"])
    others = [each for each in seen if each.startswith("dwell_") and not each.endswith(f"_{area}")]
    assert others
    assert (seen[others] == 0.0).all(axis=None), "areas that were there, and nobody looked at"


@pytest.mark.slow
def test_the_display_s_delay_is_a_setting_of_the_measures(tmp_path: Path) -> None:
    path = record(study(tmp_path), tmp_path / "data", "P001", gaze=["cab"])
    session = open_recording(path).session(1)
    late = looks(session, 15.0)
    assert late is not None
    first = session.streams["labcrane.feedback.cab.areas"].time[0]
    assert set(np.array(late.area)[late.time < first + 15.0]) == {""}
    assert "target" in set(np.array(late.area)[late.time > first + 15.0])
    table = measure_session(session, MeasureSettings(display_delay_s=1e6))
    dwells = [name for name in table if name.startswith("dwell_")]
    assert dwells
    assert table[dwells].isna().all(axis=None), "no picture was seen yet"
    assert (table["gaze_valid_during"] == 0.0).all()


def test_the_picture_changes_exactly_the_delay_after_it_was_handed_over() -> None:
    shown = np.array([1.0, 2.0])
    boxes = {"a": np.array([[0.0, 0, 10, 10], [50, 50, 60, 60]])}
    time = np.array([1.24, 1.25, 2.24, 2.25, 2.5])
    gaze = np.array([[5.0, 5.0]] * 3 + [[55.0, 55.0], [math.nan, math.nan]])
    assert looks_on_screen(time, gaze, shown, boxes, 0.25).area == ["", "a", "a", "a", ""]


def test_of_areas_within_each_other_the_smallest_is_looked_at() -> None:
    boxes = {
        "crane": np.array([[0.0, 0.0, 100.0, 100.0]]),
        "hook": np.array([[40.0, 40.0, 60.0, 60.0]]),
        "gone": np.full((1, 4), math.nan),
    }
    gaze = np.array([[50.0, 50.0], [20.0, 50.0], [500.0, 50.0]])
    found = looks_on_screen(np.array([1.0, 2.0, 3.0]), gaze, np.array([0.0]), boxes, 0.04)
    assert isinstance(found, Looks)
    assert found.area == ["hook", "crane", ""]


def test_gaze_without_a_measured_delay_or_of_another_shape_is_refused() -> None:
    time, gaze, shown = np.zeros(2), np.zeros((2, 2)), np.zeros(1)
    with pytest.raises(
        ValueError, match=r"^the display's delay is unknown, so gaze cannot be matched"
    ):
        looks_on_screen(time, gaze, shown, {}, math.nan)
    with pytest.raises(ValueError, match=r"^gaze is \(3, 2\), and 2 times need \(2, 2\)$"):
        looks_on_screen(time, np.zeros((3, 2)), shown, {}, 0.04)
    with pytest.raises(ValueError, match=r"^area 'a' is \(2, 4\), and 1 pictures need \(1, 4\)$"):
        looks_on_screen(time, gaze, shown, {"a": np.zeros((2, 4))}, 0.04)


@pytest.mark.parametrize("heading_deg", [0.0, 77.0, 200.0])
@pytest.mark.parametrize("target", [(960.0, 540.0), (300.0, 200.0)])
def test_an_offset_of_0_8_degrees_is_recovered_within_0_05(
    heading_deg: float, target: tuple[float, float]
) -> None:
    random = np.random.default_rng(4)
    px_per_m, viewing_m, centre = 3600.0, 0.7, (960.0, 540.0)
    flat = (np.array(target) - centre) / px_per_m
    straight = np.array([flat[0], flat[1], viewing_m])
    straight /= np.linalg.norm(straight)
    # The ray turned by 0.8 degrees into some direction, independently of how drift() computes.
    right = np.cross([0.0, -1.0, 0.0], straight)
    right /= np.linalg.norm(right)
    down = np.cross(straight, right)
    gaze = []
    for _ in range(240):  # two seconds at 120 Hz
        way = math.radians(0.8) * np.array(
            [math.cos(math.radians(heading_deg)), math.sin(math.radians(heading_deg))]
        ) + np.radians(random.normal(0.0, 0.25, 2))
        ray = straight + math.tan(way[0]) * right + math.tan(way[1]) * down
        gaze.append(np.array(centre) + px_per_m * viewing_m * ray[:2] / ray[2])
    gaze[10:14] = [np.array([math.nan, math.nan])] * 4  # a blink
    gaze[20:24] = [np.array([5.0, 5.0])] * 4  # a look away
    found = drift(np.array(gaze), target, centre, px_per_m, viewing_m)
    assert found["deg"] == pytest.approx(0.8, abs=0.05)
    assert 0.1 < found["spread_deg"] < 0.5
    none = drift(np.array([target] * 5), target, centre, px_per_m, viewing_m)
    assert none["deg"] == 0.0


def test_a_drift_of_nothing_but_blinks_is_refused() -> None:
    with pytest.raises(
        ValueError, match=r"^no gaze sample was valid during fixation of the target"
    ):
        drift(np.full((5, 2), math.nan), (0.0, 0.0), (0.0, 0.0), 3600.0, 0.7)
