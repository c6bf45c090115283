"""Bias and spread of adaptive levels, from simulated people whose thresholds are known."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from labcrane.cli.app import main
from labcrane.core.records import PlannedTrial
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


STUDY = """\
labcrane: 1
study: tracks
title: Tracks
machine: ch8
input: {use: dual_joystick}
scheme:
  use: joint_velocity
  map: {slew: left.x, elbow: left.y, wrist: right.x, shoulder: -right.y}
dynamics: {use: kinematic_crane}
tasks: {aiming: {use: aiming, distances: [1, 2, 3, 4, 5, 6], movements: 2}}
design:
  tracks:
    quest:
      factor: pairs
      levels: &levels
        {1m_far_left: 1, 2m_far_left: 2, 3m_far_left: 3, 4m_far_left: 4, 5m_far_left: 5}
      quest_plus: {spreads: [0.5, 1]}
      rounds: 12
    stairs:
      factor: pairs
      levels: *levels
      up_down: {}
      rounds: 30
sessions:
  - name: one
    steps:
      - block: {task: aiming, track: quest}
      - block: {task: aiming, track: stairs}
"""


@pytest.mark.slow
def test_the_command_tells_bias_and_spread_and_is_the_same_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "protocol.yaml"
    path.write_text(STUDY)
    words = ["tracks", str(path), "--operators", "200", "--spread", "0.7"]
    for name in ("one", "two"):
        assert main([*words, "--out", str(tmp_path / name)]) == 0
    said = capsys.readouterr().out
    assert "SIMULATED" in said
    table = pd.read_csv(tmp_path / "one" / "tracks.csv").set_index("track")
    people = pd.read_csv(tmp_path / "one" / "operators.csv")
    for name, own in people.groupby("track"):
        errors = (own["estimate"] - own["truth"]).dropna()
        assert table.loc[name, "bias"] == pytest.approx(errors.mean())
        assert table.loc[name, "spread"] == pytest.approx(errors.std())
    assert (people["spread"] == 0.7).all()
    assert (
        "Levels of 'quest' are chosen by QUEST+. With 200 simulated operators"
        in (tmp_path / "one" / "tracks.md").read_text()
    )
    assert (tmp_path / "one" / "tracks.png").stat().st_size > 5000
    for file in ("tracks.csv", "operators.csv", "tracks.md"):
        assert (tmp_path / "one" / file).read_bytes() == (tmp_path / "two" / file).read_bytes()


@pytest.mark.parametrize(
    ("text", "words", "message"),
    [
        (STUDY, [], "track 'stairs' is a staircase, which does not specify how steeply"),
        (STUDY, ["--spread", "0"], "--spread 0 is not a spread; give numbers above 0"),
        (STUDY.replace(", track: quest", "").replace(", track: stairs", ""), [], "has a track"),
        (
            STUDY.replace("rounds: 12", "rounds: 2")
            .replace("rounds: 30", "rounds: 2")
            .replace("up_down: {}", "up_down: {reversals: 2}"),
            ["--spread", "1"],
            "'stairs' has an estimate of 0 of 50 operators, and bias needs 20",
        ),
    ],
)
def test_what_cannot_be_told_is_refused_and_nothing_is_written(
    tmp_path: Path, text: str, words: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "protocol.yaml"
    path.write_text(text)
    arguments = ["tracks", str(path), "--operators", "50", "--out", str(tmp_path / "out"), *words]
    assert main(arguments) == 2
    assert message in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "out").exists()
