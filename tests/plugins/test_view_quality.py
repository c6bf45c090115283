"""Quality of the picture: what is drawn, what is chosen where it is measured, and what is said."""

import itertools

import numpy as np
import pytest
from windows import a_view, make_frame, shown

from labcrane_view.quality import LEVELS, MEASURED, WARM, chosen, picture_s


@pytest.mark.parametrize(
    ("took", "level"),
    [
        ({"high": 0.010}, "high"),
        ({"high": 0.025}, "high"),
        ({"high": 0.026, "medium": 0.020}, "medium"),
        ({"high": 0.9, "medium": 0.5, "low": 0.2}, "low"),
    ],
)
def test_auto_takes_the_best_that_is_quick_enough_and_says_what_each_took(
    took: dict[str, float], level: str
) -> None:
    asked = []

    def measure(each: str) -> float:
        asked.append(each)
        return took[each]

    found, said = chosen(measure)
    assert (found, asked) == (level, list(took))
    parts = [f"{each} took {1000 * seconds:.1f} ms a picture" for each, seconds in took.items()]
    assert said == f"{level} (auto: {', '.join(parts)})"


def test_a_picture_is_measured_once_textures_are_made_and_an_outlier_does_not_count() -> None:
    times = itertools.accumulate([0.0, *[0.02] * (MEASURED - 1), 5.0])
    drawn = []
    assert picture_s(lambda: drawn.append(1), lambda: next(times)) == pytest.approx(0.02)
    assert len(drawn) == WARM + MEASURED


@pytest.mark.slow
def test_the_record_says_what_auto_chose_in_this_window() -> None:
    with a_view(quality="auto", size=(160, 90)) as view:
        said = str(view.metadata()["quality"])
        assert view._level == said.split(maxsplit=1)[0]
        assert said.split(maxsplit=1)[0] in LEVELS
        view.present(make_frame())
        assert np.ptp(view.picture()) > 60


@pytest.mark.slow
def test_only_high_smooths_edges_and_only_low_has_no_shadow() -> None:
    frame = make_frame()
    pictures = {level: shown(frame, quality=level, camera="free") for level in LEVELS}
    bare = shown(frame, shadow=0, camera="free")
    np.testing.assert_array_equal(pictures["low"], bare)
    for level in ("medium", "high"):
        darker = bare.sum(axis=-1) - pictures[level].sum(axis=-1)
        assert (darker > 60).mean() > 0.005, level
    with a_view(quality="high") as view:
        assert view.metadata()["samples"] == 4
    with a_view(quality="medium") as view:
        assert view.metadata()["samples"] == 1


def test_shadows_of_what_stands_still_are_drawn_for_the_first_pictures_only() -> None:
    with a_view(quality="medium") as view:
        pictures = []
        for number in range(6):
            view.present(make_frame(number))
            pictures.append(view.picture())
        active = {each.get_name(): each.is_active() for each in view._opened().engine.get_windows()}
    assert (active["still"], active["moving"]) == (False, True)
    np.testing.assert_array_equal(pictures[-1], pictures[1])
