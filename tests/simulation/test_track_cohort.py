"""Bias and spread of adaptive levels, from simulated people whose thresholds are known."""

import numpy as np
import pandas as pd
import pytest

from labcrane.core import PlannedTrial
from labcrane.design.tracks import PlannedTrack, plan_rounds
from labcrane.design.up_down import settles_at
from labcrane.protocol.tracks import QuestPlus, Track, UpDown
from labcrane.simulation.track_cohort import Ability, abilities, observe, quality

LEVELS = {f"l{at}": float(at) for at in range(13)}


def planned(rounds: int, **law: UpDown | QuestPlus) -> PlannedTrack:
    track = Track(factor="f", levels=LEVELS, rounds=rounds, **law)
    made = {level: plan_rounds("t", level, [PlannedTrial({}, expected_s=1.0)]) for level in LEVELS}
    return PlannedTrack("t", track, 1, rounds, made)


@pytest.mark.slow
@pytest.mark.parametrize("guess", [0.0, 0.25])
def test_quest_plus_recovers_thresholds_with_a_bias_under_a_twentieth_of_their_spread(
    guess: float,
) -> None:
    """2,500 people: the standard error of what is asserted is 0.02."""
    track = planned(30, quest_plus=QuestPlus(spreads=(0.5, 1.0, 2.0), guess=guess, lapse=0.02))
    found = quality(track, observe(track, abilities(track, 2500, (), seed=4), seed=5))
    assert abs(found.bias_in_sd) < 0.05
    assert found.without == 0
    assert found.bias_low < found.bias < found.bias_high
    # It finds something: thresholds themselves spread by 12 / sqrt(12).
    assert found.spread < (0.3 if guess == 0.0 else 0.45) * 12 / np.sqrt(12)


@pytest.mark.slow
def test_what_quest_plus_says_of_its_own_error_is_its_error() -> None:
    track = planned(25, quest_plus=QuestPlus(spreads=(1.0,)))
    people = observe(track, abilities(track, 1500, (), seed=6), seed=7)
    errors = (people["estimate"] - people["truth"]) / people["sd"]
    assert errors.std() == pytest.approx(1.0, abs=0.06)


@pytest.mark.slow
def test_what_is_off_at_the_ends_is_told_besides_the_mean_that_hides_it() -> None:
    track = planned(15, quest_plus=QuestPlus(spreads=(2.0,), lapse=0.02))
    found = quality(track, observe(track, abilities(track, 1000, (), seed=2), seed=3))
    lowest, highest = (
        quality(track, observe(track, [Ability(at, 2.0, 0.0, 0.02) for at in tenth], seed=4))
        for tenth in (np.linspace(0.0, 1.2, 400), np.linspace(10.8, 12.0, 400))
    )
    assert abs(found.bias_in_sd) < 0.05
    assert found.bias_lowest == pytest.approx(lowest.bias, abs=0.15)
    assert found.bias_highest == pytest.approx(highest.bias, abs=0.15)
    assert found.bias_lowest > 0.4 * found.spread
    assert found.bias_highest < -0.4 * found.spread


def test_a_tenth_is_a_tenth_of_those_of_whom_there_is_an_estimate() -> None:
    truth = np.arange(30.0)
    error = np.where(truth < 2, 5.0, np.where(truth < 4, 7.0, 0.0))
    error[-1] = np.nan
    error[-2:-4:-1] = -3.0, -4.0
    table = pd.DataFrame({"truth": truth, "estimate": truth + error, "trials": 1, "ended": 1.0})
    found = quality(planned(9, up_down=UpDown()), table.sample(frac=1.0, random_state=1))
    assert found.bias_lowest == 5.0  # 29 of them: two at either end
    assert found.bias_highest == -3.5
    assert found.bias == pytest.approx((2 * 5 + 2 * 7 - 7) / 29)


@pytest.mark.slow
def test_a_staircase_finds_the_level_at_which_it_settles() -> None:
    law = UpDown(harder_after=2, easier_after=1, steps=(2, 1), reversals=20, leave_out=4)
    track = planned(300, up_down=law)
    people = [person for person in abilities(track, 900, (2.0,), 8) if 4 < person.threshold < 10]
    found = quality(track, observe(track, people, seed=9))
    assert abs(found.bias) < 0.35  # levels are 1 apart; a staircase's mean is not unbiased
    assert found.ended == 1.0
    person = people[0]
    assert person.success(person.level_of(settles_at(law))) == pytest.approx(0.5**0.5)


def test_chance_and_lapses_are_the_ends_of_what_is_likely() -> None:
    person = Ability(5.0, 1.0, guess=0.2, lapse=0.1)
    assert person.success(-100.0) == pytest.approx(0.9)
    assert person.success(100.0) == pytest.approx(0.2)
    assert person.success(5.0) == pytest.approx(0.55)
