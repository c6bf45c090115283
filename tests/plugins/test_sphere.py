"""The sphere's laws, against closed forms."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as some
from pydantic import ValidationError

from labcrane import Cue, Signal
from labcrane.testing import TARGETS, CueContract, ch8, make_run, make_target
from labcrane_sphere.settings import SphereSettings
from labcrane_sphere.sphere import SphereCue


class TestSphere(CueContract):
    """Offered as "sphere"."""

    @pytest.fixture
    def cue(self) -> Cue:
        return SphereCue(SphereSettings())


def test_size_and_brightness_change_evenly_with_distance() -> None:
    sphere = SphereCue(SphereSettings(far=4.0, smallest=0.1, largest=0.5, darkest=0.2))
    looks = [sphere.look(distance) for distance in (0.0, 1.0, 2.0, 4.0)]
    np.testing.assert_allclose(looks, [(0.1, 1.0), (0.2, 0.8), (0.3, 0.6), (0.5, 0.2)])


def test_beyond_far_nothing_changes() -> None:
    sphere = SphereCue(SphereSettings(far=4.0))
    assert sphere.look(4.0) == sphere.look(40.0)


def test_the_logarithmic_law_changes_most_near_the_target() -> None:
    sphere = SphereCue(SphereSettings(far=4.0, law="log", smallest=0.2, largest=1.2))
    radii = [sphere.look(distance)[0] - 0.2 for distance in (0.0, 0.4, 4.0)]
    np.testing.assert_allclose(radii, [0.0, math.log10(1.9), 1.0])


@given(some.floats(0.0, 10.0))
def test_the_other_polarity_is_the_mirror_image(distance: float) -> None:
    one = SphereCue(SphereSettings())
    other = SphereCue(SphereSettings(polarity="grows", brightness="darkens"))
    sums = np.add(one.look(distance), other.look(distance))
    np.testing.assert_allclose(sums, [0.15 + 0.60, 0.25 + 1.0])


@pytest.mark.parametrize("at", ["tip", "target"])
def test_it_is_drawn_where_it_should_be(at: str) -> None:
    run = make_run(ch8(), task=TARGETS)
    sphere = SphereCue(SphereSettings(at=at))
    sphere.open(run)
    frame = make_target(run)
    place = {"tip": frame.state[run.state.find("tip.position")], "target": frame.task[:3]}[at]
    (ball,) = sphere.draw(frame)
    np.testing.assert_array_equal(ball.centre, place)
    distance, radius, brightness = sphere.values(frame)
    assert distance == pytest.approx(math.dist(frame.task[:3], frame.state[8:11]))
    assert ball.radius == radius
    np.testing.assert_allclose(ball.colour[:3], brightness * np.array((0.15, 0.75, 1.0)))


def test_its_opacity_follows_an_estimate_within_trials_and_never_faster_than_its_limit() -> None:
    law = {"estimate": "load.ratio", "between": [1, 3], "to": [0.2, 0.8], "at_most_per_s": 0.4}
    sphere = SphereCue(SphereSettings(opacity=law))
    run = make_run(ch8(), axes=[Signal("estimate.load.ratio", "")], task=TARGETS)
    sphere.open(run)

    def opacity(ratio: float, trial: int, elapsed: float) -> float:
        frame = make_target(run)
        frame.axes[:], frame.trial, frame.elapsed = ratio, trial, elapsed
        (ball,) = sphere.draw(frame)
        assert sphere.values(frame)[3] == ball.colour[3]
        return ball.colour[3]

    seen = [
        opacity(*each)
        for each in (
            (3.0, 1, 0.0),  # it begins with the first
            (3.0, 1, 1.0),
            (3.0, 1, 1.0),  # a pause
            (3.0, 3, 9.0),  # another trial
            (3.0, 3, 9.5),
            (9.0, 3, 11.0),
            (2.0, 3, 11.5),
            (2.0, 3, 19.0),
            (2.0, 3, 0.0),  # another attempt
        )
    ]
    assert seen == pytest.approx([0.2, 0.6, 0.6, 0.6, 0.8, 0.8, 0.6, 0.5, 0.5])


def test_sizes_the_wrong_way_round_are_refused() -> None:
    with pytest.raises(ValidationError, match="smallest is 2 m and largest 1 m; exchange them"):
        SphereSettings(smallest=2.0, largest=1.0)
