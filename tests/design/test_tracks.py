"""Levels that are chosen by what somebody does, against theory and an independent QUEST+."""

import math
from pathlib import Path

import numpy as np
import pytest
from needs import needs
from rehearsal import loaded
from scipy.stats import norm

from labcrane import ProtocolError
from labcrane.design.quest_plus import THRESHOLDS
from labcrane.design.tracks import PlannedTrack, Response, check_carried, standing
from labcrane.design.up_down import climb, settles_at
from labcrane.protocol.tracks import QuestPlus, Track, UpDown

TEN = {f"l{at}": float(at) for at in range(10)}
QUEST = Track(factor="f", levels=TEN, quest_plus=QuestPlus(spreads=(0.5, 1.0, 2.0)))


def seen(text: str, levels: str) -> list[tuple[str, bool]]:
    """Return responses written as ``++-`` at levels written as ``001``."""
    return [(f"l{level}", sign == "+") for sign, level in zip(text, levels, strict=True)]


def test_a_staircase_gets_harder_after_two_successes_and_easier_after_one_failure() -> None:
    """Worked by hand after Levitt (1971), one level at a time."""
    signs, levels, nexts = "++++-++-", "00112112", "001121121"
    for count in range(len(signs) + 1):
        stairs = climb(UpDown(), TEN, "", seen(signs[:count], levels[:count]))
        assert stairs.level == f"l{nexts[count]}", count
    assert climb(UpDown(), TEN, "", seen(signs, levels)).turns == (2.0, 1.0, 2.0)


def test_steps_get_smaller_with_each_reversal_and_the_last_one_stays() -> None:
    settings = UpDown(harder_after=1, steps=(4, 2, 1))
    found, responses = ["l0"], []
    for sign in "+-+-":
        responses += [(found[-1], sign == "+")]
        found.append(climb(settings, TEN, "", responses).level)
    assert found == ["l0", "l4", "l2", "l3", "l2"]


def test_at_the_hardest_level_it_stays_and_that_is_no_reversal() -> None:
    stairs = climb(UpDown(harder_after=1), TEN, "l9", seen("+++", "999"))
    assert (stairs.level, stairs.turns) == ("l9", ())


def test_successes_at_another_level_do_not_count_on() -> None:
    assert climb(UpDown(), TEN, "", seen("++", "01")).level == "l0"


def test_reversals_of_earlier_blocks_do_not_end_the_next_one() -> None:
    track = Track(factor="f", levels=TEN, up_down=UpDown(harder_after=1, reversals=2, leave_out=0))
    zigzag = seen("+-+", "010")
    assert standing(track, (), zigzag).level is None
    assert standing(track, zigzag, ()).level == "l1"
    assert standing(track, zigzag, seen("-", "1")).estimate != 1.0  # one reversal is no mean


@pytest.mark.parametrize(
    ("harder", "easier", "share"), [(1, 1, 0.5), (2, 1, 0.5**0.5), (3, 1, 0.794)]
)
def test_a_staircase_settles_where_levitt_says(harder: int, easier: int, share: float) -> None:
    found = settles_at(UpDown(harder_after=harder, easier_after=easier))
    assert found == pytest.approx(share, abs=5e-4)


def test_a_staircase_settles_there_with_simulated_people() -> None:
    """Over long runs at 0.1-wide levels, the share of successes is the one it settles at."""
    levels = {f"l{at}": at / 10 for at in range(100)}
    settings = UpDown(harder_after=3, easier_after=1, reversals=1000)
    random = np.random.default_rng(5)
    place, right, seen_, wins = 50, 0, 0, 0
    for trial in range(20_000):  # the same law written again, without its history
        success = random.uniform() < 0.5 * math.erfc((levels[f"l{place}"] - 5.0) / math.sqrt(2.0))
        if trial > 500:
            seen_, wins = seen_ + 1, wins + success
        right = right + 1 if success else 0
        if not success or right == settings.harder_after:
            place, right = min(max(place + (1 if success else -1), 0), 99), 0
    assert wins / seen_ == pytest.approx(settles_at(settings), abs=0.02)


@needs("questplus")
def test_quest_plus_chooses_and_believes_as_an_independent_library_does() -> None:
    import questplus

    numbers = list(TEN.values())
    theirs = questplus.QuestPlus(
        stim_domain={"intensity": np.array(numbers)},
        param_domain={
            "mean": np.linspace(0.0, 9.0, THRESHOLDS),
            "sd": np.array([0.5, 1.0, 2.0]),
            "lower_asymptote": [0.02],  # theirs grows with the level: a success is our failure
            "lapse_rate": [0.1],
        },
        outcome_domain={"response": ["Yes", "No"]},
        func="norm_cdf",
        stim_scale="linear",
        stim_selection_method="min_entropy",
        param_estimation_method="mean",
    )
    settings = QuestPlus(spreads=(0.5, 1.0, 2.0), guess=0.1, lapse=0.02)
    track = Track(factor="f", levels=TEN, quest_plus=settings)
    random, responses = np.random.default_rng(8), []
    for _ in range(25):
        mine = standing(track, (), responses)
        assert TEN[mine.level] == pytest.approx(theirs.next_stim["intensity"])
        success = bool(random.uniform() < norm.cdf((6.3 - TEN[mine.level]) / 1.0))
        theirs.update(
            stim={"intensity": TEN[mine.level]}, outcome={"response": "No" if success else "Yes"}
        )
        responses.append((mine.level, success))
        assert standing(track, (), responses).estimate == pytest.approx(
            theirs.param_estimate["mean"], abs=1e-9
        )


def test_quest_plus_does_not_mind_in_which_order_it_is_told() -> None:
    random = np.random.default_rng(2)
    told = [(f"l{random.integers(10)}", bool(random.integers(2))) for _ in range(40)]
    one = standing(QUEST, (), told)
    other = standing(QUEST, told[20:], told[:20])
    assert one.level == other.level
    assert one.estimate == pytest.approx(other.estimate, abs=1e-12)


def test_quest_plus_ends_when_the_threshold_is_known_well_enough() -> None:
    track = QUEST.model_copy(update={"quest_plus": QuestPlus(spreads=(0.5,), until_sd=0.4)})
    told: list[tuple[str, bool]] = []
    while (where := standing(track, (), told)).level is not None:
        assert where.sd > 0.4
        told.append((where.level, TEN[where.level] < 4.2))
    assert where.sd <= 0.4
    assert 3 < len(told) < 30
    assert where.estimate == pytest.approx(4.2, abs=0.8)


def test_impossible_answers_leave_something_to_believe() -> None:
    sure = Track(factor="f", levels=TEN, quest_plus=QuestPlus(spreads=(0.01,), lapse=0.0))
    where = standing(sure, (), [("l0", False), ("l9", True)] * 10)
    assert math.isfinite(where.estimate)
    assert where.level in TEN


def test_a_response_at_a_level_that_is_gone_is_refused_before_a_session() -> None:
    with pytest.raises(ProtocolError, match="had its level 'l77', and it has l0, l1"):
        check_carried({"t": QUEST}, [Response("t", "l77", success=True)])


def test_a_response_is_read_from_a_row_of_journal_or_table() -> None:
    assert Response.of({"trial": 1}) is None
    row = {"track": "t", "track_level": "l1", "track_success": 0}
    assert Response.of(row) == Response("t", "l1", success=False)
    assert Response.of({**row, "track_success": None}) == Response("t", "l1", success=None)


HEAD = """\
labcrane: 1
study: tracks
title: Tracks
machine: ch8
input: {use: dual_joystick}
scheme:
  use: joint_velocity
  map: {slew: left.x, elbow: left.y, wrist: right.x, shoulder: -right.y}
dynamics: {use: kinematic_crane}
tasks: {aiming: {use: aiming, distances: [1, 2, 3], movements: 2}}
design:
  tracks:
    reach:
      factor: pairs
      levels: {1m_far_left: 1, 2m_far_left: 2, 3m_far_left: 3}
      up_down: {}
sessions: [{name: one, steps: [{block: {task: aiming, track: reach}}]}]
"""


def test_the_study_of_these_mistakes_is_fine_without_them(tmp_path: Path) -> None:
    path = tmp_path / "protocol.yaml"
    path.write_text(HEAD)
    assert loaded(path).protocol.design.tracks["reach"].rounds == 40


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("track: reach", "track: raech", r":17:.*no track 'raech'; did you mean 'reach'"),
        ("factor: pairs", "factor: pear", r":14:.*does not vary 'pear'; .*pairs"),
        ("1m_far_left: 1", "1m_far_lift: 1", r":15:.*pairs has no level '1m_far_lift'; did you"),
        (
            "1m_far_left: 1",
            "1m_far_left: 2",
            "levels '1m_far_left' and '2m_far_left' are equally hard",
        ),
        ("up_down: {}", "carry: true", "neither is there; one of up_down and quest_plus"),
        ("up_down: {}", "up_down: {}\n      quest_plus: {spreads: [1]}", "both are there; one of"),
        (
            "up_down: {}",
            "up_down: {}\n      start: 9m",
            "start is '9m', which is not a level; there",
        ),
        ("up_down: {}", "up_down: {}\n      measure: error", "a measure has at_least, at_most"),
        (
            "up_down: {}",
            "up_down: {}\n      measure: eror\n      at_most: 1",
            "no result 'eror'; did you mean 'error'",
        ),
        ("up_down: {}", "up_down: {reversals: 4, leave_out: 3}", "of 4 reversals 3 are left out"),
        (
            "up_down: {}",
            "quest_plus: {spreads: [1], guess: 0.6, lapse: 0.4}",
            "leave nothing to be",
        ),
        ("track: reach", "track: reach, pairs: 2", "track 'reach' chooses pairs; drop the limit"),
        ("track: reach", "track: reach, fading: [1, 0]", "parts of a block are not known before"),
        (
            "block: {task: aiming",
            "practice: {task: aiming, until: {successes: 2}",
            "a block with a track ends by the track's own rule; drop until",
        ),
    ],
)
def test_what_cannot_be_is_refused_with_its_line(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    path = tmp_path / "protocol.yaml"
    path.write_text(HEAD.replace(old, new))
    with pytest.raises(ProtocolError, match=message):
        loaded(path)


def test_a_round_under_way_keeps_its_level(tmp_path: Path) -> None:
    from labcrane.testing import plan_session

    path = tmp_path / "protocol.yaml"
    path.write_text(HEAD)
    (block,) = plan_session(loaded(path), "P001", 1).blocks
    track = block.track
    assert isinstance(track, PlannedTrack)
    assert (track.size, track.count, len(block.trials)) == (3, 120, 120)
    done = {
        1: Response("reach", "1m_far_left", success=None),
        2: Response("reach", "1m_far_left", success=True),
        3: Response("reach", "1m_far_left", success=True),
    }
    after = track.choose(block.trials[3], done)
    assert after.planned.condition["track_level"] == "2m_far_left"
    assert not after.planned.counted  # the approach of the next round
    begun = {**done, 4: Response("reach", "3m_far_left", success=None)}
    kept = track.choose(block.trials[4], begun)
    assert kept.planned.condition["track_level"] == "3m_far_left"
    assert kept.planned.condition["distance"] == 3.0


def test_no_table_of_quest_plus_is_made_at_a_choice(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whoever plans a session makes it: in the loop it would take as long as a tick."""
    from labcrane.design import quest_plus
    from labcrane.testing import plan_session

    quest_plus.grid.cache_clear()
    path = tmp_path / "protocol.yaml"
    path.write_text(HEAD.replace("up_down: {}", "quest_plus: {spreads: [0.5, 1]}"))
    (block,) = plan_session(loaded(path), "P001", 1).blocks
    made = quest_plus.grid.cache_info().misses
    assert made == 1

    def refuse(*_: object) -> None:
        raise AssertionError("a table is made in the loop")

    monkeypatch.setattr(quest_plus.Grid, "__init__", refuse)
    chosen = block.track.choose(block.trials[0], {})
    assert chosen.planned.condition["track_level"] in block.track.settings.levels
    told = {2: Response("reach", "1m_far_left", success=True)}
    assert block.track.choose(block.trials[3], told).number == 4
    assert block.track.stands(told).responses == 1
    assert quest_plus.grid.cache_info().misses == made
