"""The n-back task: its order of balls, its contract, and its markers at another program."""

import json

import numpy as np
import pylsl
import pytest
from labcrane_nback import PLACES, Nback, NbackBall, NbackSettings, order

from labcrane import Cue, Feedback
from labcrane.testing import (
    TARGETS,
    CueContract,
    FeedbackContract,
    ch8,
    make_run,
    make_target,
    opened,
)


class TestBall(CueContract):
    @pytest.fixture
    def cue(self) -> Cue:
        return NbackBall(NbackSettings())


class TestNback(FeedbackContract):
    @pytest.fixture
    def feedback(self) -> Feedback:
        return Nback(NbackSettings())


@pytest.mark.parametrize("back", [1, 2, 3])
def test_matches_are_where_the_ball_was_and_as_frequent_as_wanted(back: int) -> None:
    balls = order(NbackSettings(back=back, match_share=0.3), trial=4)
    places = np.array(balls.places)
    np.testing.assert_array_equal(balls.matches[back:], places[back:] == places[:-back])
    assert not any(balls.matches[:back])
    assert abs(np.mean(balls.matches) - 0.3) < 0.05  # 1000 draws: three standard errors
    assert set(places) == set(range(len(PLACES)))


def test_every_trial_has_an_order_of_its_own_that_comes_back() -> None:
    settings = NbackSettings()
    assert order(settings, 1) == order(settings, 1)
    assert order(settings, 1) != order(settings, 2)


def test_markers_of_balls_and_presses_reach_another_program() -> None:
    run = make_run(ch8(), task=TARGETS)
    settings = NbackSettings(period_s=0.1)
    nback = Nback(settings)
    with opened(nback, run):
        (info,) = pylsl.resolve_byprop("name", "nback", 1, timeout=10.0)
        inlet = pylsl.StreamInlet(info)
        inlet.open_stream(timeout=10.0)
        for number in range(48):  # a fifth of a second: two balls
            frame = make_target(run, number)
            frame.axes[run.axes.index("right.trigger")] = 30 <= number < 36
            nback.present(frame)
        heard = [inlet.pull_sample(timeout=5.0) for _ in range(3)]
    said = [json.loads(sample[0]) for sample, _ in heard]
    assert [(each["event"], each["ball"]) for each in said] == [
        ("ball", 0),
        ("ball", 1),
        ("press", 1),
    ]
    assert [said[0]["place"], said[1]["place"]] == list(order(settings, 1).places[:2])
    assert heard[2][1] == pytest.approx(30 / run.rate_hz)
