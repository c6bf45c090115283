"""The n-back task: its order of balls, its contract, its answers."""

import numpy as np
import pytest
from labcrane_nback import PLACES, Nback, NbackSettings, order

from labcrane import SecondaryTask
from labcrane.testing import SecondaryTaskContract, ch8, make_frame, make_run, make_trial, opened


class TestNback(SecondaryTaskContract):
    @pytest.fixture
    def secondary(self) -> SecondaryTask:
        return Nback(NbackSettings())


@pytest.mark.parametrize("back", [1, 2, 3])
def test_matches_are_where_the_ball_was_and_as_frequent_as_wanted(back: int) -> None:
    balls = order(NbackSettings(back=back, match_share=0.3), seed=4)
    places = np.array(balls.places)
    np.testing.assert_array_equal(balls.matches[back:], places[back:] == places[:-back])
    assert not any(balls.matches[:back])
    assert abs(np.mean(balls.matches) - 0.3) < 0.05  # 1000 draws: three standard errors
    assert set(places) == set(range(len(PLACES)))


def test_every_seed_has_an_order_of_its_own_that_comes_back() -> None:
    settings = NbackSettings()
    assert order(settings, 1) == order(settings, 1)
    assert order(settings, 1) != order(settings, 2)


def test_a_press_at_every_match_is_a_hit_and_no_other_press() -> None:
    run, settings = make_run(ch8()), NbackSettings(period_s=0.1)
    nback, said = Nback(settings), []
    with opened(nback, run):
        nback.begin_trial(make_trial(seed=1))
        for number in range(960):  # four seconds: forty balls
            frame = make_frame(run, number)
            at, within = divmod(number, 24)
            matches = order(settings, 1).matches[at]
            frame.axes[run.axes.index("right.trigger")] = float(matches and 6 <= within < 12)
            said += nback.evaluate(frame).events
        measured = nback.measure()
    assert measured == {"hit_share": 1.0, "false_share": 0.0}
    balls = [event.data["place"] for event in said if event.name == "nback.ball"]
    assert balls == list(order(settings, 1).places[:40])
    assert all(event.data["right"] for event in said if event.name == "nback.press")


def test_a_ball_that_the_end_of_the_trial_cuts_off_is_not_counted() -> None:
    run, settings = make_run(ch8()), NbackSettings(period_s=0.5)
    seed = next(k for k in range(99) if order(settings, k).matches[2:4] == (True, True))
    with opened(nback := Nback(settings), run):
        nback.begin_trial(make_trial(seed=seed))
        for number in range(3 * 120 + 60):  # three balls, and half of a fourth
            frame = make_frame(run, number)
            frame.axes[run.axes.index("right.trigger")] = float(number == 300)
            nback.evaluate(frame)
        assert nback.measure() == {"hit_share": 1.0, "false_share": 0.0}
