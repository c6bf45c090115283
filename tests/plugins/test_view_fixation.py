"""Fixation target in the picture: where it is, how large, and what is seen beside it."""

import numpy as np
import pytest
from windows import SIZE, a_view, make_frame

from labcrane.analysis import Glass
from labcrane.analysis.gaze import _glass
from labcrane.core import SessionState
from labcrane_view.fixation import DISC, GREY

POINTS = [(0.5, 0.5), (0.1, 0.2), (0.85, 0.7)]


def picture(point: tuple[float, ...], *, paused: bool = False, **settings: object) -> np.ndarray:
    with a_view(**settings) as view:
        view.update(SessionState(fixation=point, counts={"trial.start": 1}))
        frame = make_frame()
        frame.paused = paused
        view.present(frame)
        view.present(frame)
        return view.picture().astype(int)


def dark(seen: np.ndarray) -> tuple[float, float, float, float]:
    """Return left, top, right and bottom of what is black, in pixels."""
    rows, columns = np.nonzero(seen.max(axis=2) < 20)
    return columns.min(), rows.min(), columns.max() + 1, rows.max() + 1


@pytest.mark.parametrize("renderer", ["auto", "software"])
@pytest.mark.parametrize("point", POINTS)
def test_the_target_is_at_its_share_of_the_picture_on_plain_grey(
    renderer: str, point: tuple[float, float]
) -> None:
    seen = picture(point, renderer=renderer, hud=("distance",))
    left, top, right, bottom = dark(seen)
    middle = (left + right) / 2, (top + bottom) / 2
    assert middle == pytest.approx((point[0] * SIZE[0], point[1] * SIZE[1]), abs=1.0)
    assert (right - left, bottom - top) == pytest.approx((DISC * SIZE[1],) * 2, abs=1.5)
    beside = np.ones(SIZE[::-1], bool)
    beside[top - 1 : bottom + 1, left - 1 : right + 1] = False
    assert np.abs(seen[beside] - 255 * GREY[0]).max() <= 1, "nothing else is to be looked at"


def test_the_disc_is_six_tenths_of_a_degree_where_the_eye_s_distance_is_known() -> None:
    """A metre of glass, 640 px wide, from two metres: 0.6 degrees are 13.4 px."""
    seen = picture((0.5, 0.5), screen_mm=1000.0, viewing_m=2.0)
    left, top, right, bottom = dark(seen)
    wide = 2.0 * 2.0 * np.tan(np.radians(0.3)) * SIZE[0]
    assert (right - left, bottom - top) == pytest.approx((wide, wide), abs=1.5)


@pytest.mark.slow
def test_the_examiner_sees_the_scene_and_so_does_everybody_in_a_pause() -> None:
    still, shown = (picture(point, seen_by="examiner") for point in ((), (0.5, 0.5)))
    np.testing.assert_array_equal(still, shown)
    held, running = (picture(point, paused=True) for point in ((), (0.5, 0.5)))
    np.testing.assert_array_equal(held, running)


def test_the_photodiode_s_patch_stays_over_it() -> None:
    seen = picture((0.5, 0.5), patch={"size": 40})
    assert seen[-40:, :40].min() == 255, "white after one event of its kind"


def test_analysis_knows_the_picture_by_what_the_view_says_of_itself() -> None:
    told = {"screen_mm": 1000.0, "viewing_m": 2.0, "flip": "horizontal"}
    with a_view(**told) as view:
        facts = ", ".join(f"{name} {value}" for name, value in view.metadata().items())
    assert _glass(facts) == Glass(SIZE, "horizontal", 640.0, 2.0)
    with a_view(seen_by="examiner") as view:
        facts = ", ".join(f"{name} {value}" for name, value in view.metadata().items())
    assert _glass(facts) is None
