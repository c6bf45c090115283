"""Attempts: whatever cuts a movement off, the next attempt has the movement's whole path."""

import json
import random
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pytest
from rehearsal import SHORT, DiesError, DiesInTrial, StallingClock, a_study, rehearse

from labcrane import Trial, open_recording
from labcrane.core import PlannedTrial
from labcrane.design.tracks import LEVEL, PlannedTrack, plan_rounds
from labcrane.protocol.tracks import Track, UpDown
from labcrane.recording import SessionRecord
from labcrane.replay import replay_session
from labcrane.testing import Command, Order, QueueConsole, Study, Visit, run

ANGLES = slice(0, 4)

LONG = SHORT.replace("pairs: 1", "pairs: 2")


@pytest.fixture
def study(tmp_path: Path) -> Study:
    return a_study(tmp_path, LONG)


@pytest.mark.parametrize("seed", range(3))
def test_a_movement_that_is_repeated_begins_where_its_first_attempt_began(
    study: Study, seed: int
) -> None:
    """By order, by a stall and by both, in the approach to a first target too."""
    dice = random.Random(seed)
    plain = rehearse(study)
    trial = dice.randint(1, 5)
    ticks = [number for number, frame in enumerate(plain.frames) if frame.trial == trial]
    orders, stalls = {}, {}
    cut_off = dice.sample(range(len(ticks) // 4, len(ticks) - 2), 1)[0]
    if seed % 2:
        stalls[ticks[cut_off]] = dice.uniform(0.3, 2.0)
    else:
        orders[ticks[cut_off]] = [Command(Order.REPEAT)]
    if seed > 1:  # the second attempt is cut off as well
        orders[ticks[cut_off] + round(240 * sum(stalls.values())) + dice.randint(20, 90)] = [
            Command(Order.REPEAT)
        ]
    seen = rehearse(study, orders, clock=StallingClock(stalls))
    attempts = 2 + (seed > 1)
    starts = [
        number
        for number, frame in enumerate(seen.frames)
        for event in frame.events
        if event.name == "trial.start" and event.data["trial"] == trial
    ]
    assert len(starts) == attempts
    first = seen.frames[starts[0]].state[ANGLES]
    moved = seen.frames[starts[1] - 1].state[ANGLES]
    assert np.abs(moved - first).max() > np.radians(1.0), "it had moved on when it was cut off"
    for start in starts[1:]:
        # A tick of what the machine still did lies between.
        np.testing.assert_allclose(seen.frames[start].state[ANGLES], first, atol=0.005)
    # Every other movement begins where the one before it has ended.
    for number, (before, after) in enumerate(pairwise(seen.frames), start=1):
        if number not in starts[1:]:
            step = np.abs(after.state[ANGLES] - before.state[ANGLES]).max()
            assert step < 0.005, number


def whole_paths(session: SessionRecord) -> pd.Series:
    """Return how far each successful movement's tip was from its end at its start, in m."""
    trials = session.trials.query("outcome == 'success'")
    state, task = session.streams["state"], session.streams["task"]
    distances = {}
    for row in trials.itertuples():
        at = int(np.searchsorted(state.time, row.started))
        tip = state.data.filter(like="tip.position").iloc[at].to_numpy()
        target = task.data.filter(like="target.position").iloc[at].to_numpy()
        distances[int(row.trial)] = float(np.linalg.norm(tip - target))
    return pd.Series(distances)


@pytest.mark.slow
@pytest.mark.parametrize("policy", ["redo_trial", "redo_block"])
@pytest.mark.parametrize("seed", range(2))
def test_a_movement_that_a_kill_cut_off_has_its_whole_path_after_the_resumption(
    study: Study, tmp_path: Path, policy: str, seed: int
) -> None:
    dice = random.Random(f"{policy}{seed}")
    visit = Visit(study, "P001", 1, tmp_path / "plain", simulated=True, fast=True)
    planned = whole_paths(open_recording(run(visit, QueueConsole())).session(1))
    killed = replace(visit, data=tmp_path / "killed")
    trial = dice.choice([2, 3, 5])
    with pytest.raises(DiesError):
        run(killed, DiesInTrial(trial, dice.randint(900, 1500)))
    again = replace(killed, resumed=True, policy=policy)
    if seed:  # and again
        with pytest.raises(DiesError):
            run(again, DiesInTrial(trial, dice.randint(900, 1500)))
    path = run(again, QueueConsole())
    session = open_recording(path).session(1)
    got = whole_paths(session)
    assert list(got.index) == list(planned.index)
    # The machine stands within the radius of the target where the movement before has ended.
    assert np.abs(got - planned).max() < 0.3


@pytest.mark.slow
def test_a_recording_with_repeated_movements_is_replayed_bit_for_bit(
    study: Study, tmp_path: Path
) -> None:
    class Repeats(QueueConsole):
        tick = 0

        def commands(self) -> list[Command]:  # type: ignore[override]
            self.tick += 1
            return [Command(Order.REPEAT)] if self.tick in {1200, 4800, 7000} else []

    visit = Visit(study, "P001", 1, tmp_path / "data", simulated=True, fast=True)
    path = run(visit, Repeats())
    assert "repeated" in set(open_recording(path).session(1).trials["outcome"])
    assert replay_session(path, 1).difference is None
    # Recordings of before trials were set back say nothing of it, and go on where they were.
    with h5py.File(path, "r+") as file:
        context = json.loads(file["ses-01/context"][()])
        assert context.pop("sets_back") is True
        del file["ses-01/context"]
        file["ses-01/context"] = json.dumps(context)
    assert replay_session(path, 1).difference is not None


@pytest.mark.parametrize("seed", range(3))
def test_a_track_begins_each_trial_where_its_level_is_planned_to(seed: int) -> None:
    """Every first attempt began at the pose of the track's first level."""
    dice = random.Random(seed)
    poses = {f"{level}": (dice.random(), dice.random()) for level in range(3)}
    rounds = {
        name: plan_rounds("t", name, [PlannedTrial({}, 1.0, start_pose=pose)])
        for name, pose in poses.items()
    }
    settings = Track(factor="f", levels={"0": 0.0, "1": 1.0, "2": 2.0}, up_down=UpDown(), start="2")
    track = PlannedTrack("t", settings, 1, 3, rounds)
    planned = rounds["0"][0]
    again = (0.5, 0.5)
    for trial in (Trial(1, 1, 0, planned), Trial(1, 2, 0, planned, again)):
        chosen = track.choose(trial, {})
        assert chosen is not None
        assert chosen.planned.condition[LEVEL] == "2"
        assert chosen.planned.start_pose == poses[str(chosen.planned.condition[LEVEL])]
        assert chosen.start_pose == trial.start_pose
