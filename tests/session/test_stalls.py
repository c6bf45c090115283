"""Stalls: the session's process stands still for a while, and has missed ticks when it goes on."""

import random
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rehearsal import DiesError, DiesInTrial, Rehearsal, StallingClock, a_study, rehearse

from labcrane import Frame, open_recording
from labcrane.core.clock import Clock
from labcrane.protocol.protocol import OnFault
from labcrane.replay import replay_session
from labcrane.session import session as session_module
from labcrane.session.resume import Progress
from labcrane.testing import Command, Order, QueueConsole, Study, Visit, run

LIMIT_S = 0.25
"""The default of ``presented.max_gap_s``."""

ANGLES = slice(0, 4)


@pytest.fixture
def study(tmp_path: Path) -> Study:
    return a_study(tmp_path)


def outcomes(seen: Rehearsal) -> list[tuple[object, object, object]]:
    return [(row["trial"], row["attempt"], row["outcome"]) for row in seen.trials()]


def ticks_of(seen: Rehearsal, trial: int) -> list[int]:
    return [number for number, frame in enumerate(seen.frames) if frame.trial == trial]


def missed(frames: list[Frame], stalls: Mapping[int, float]) -> list[Frame]:
    """Return the frames that were due before the loop woke up from a stall."""
    woke = {tick: frames[tick].tick.woke for tick in stalls}
    return [
        frame
        for number, frame in enumerate(frames)
        if any(number >= tick and frame.tick.due < at for tick, at in woke.items())
    ]


@pytest.mark.parametrize("seed", range(3))
def test_a_movement_with_a_stall_is_interrupted_and_repeated_and_the_machine_rests(
    study: Study, seed: int
) -> None:
    dice = random.Random(seed)
    plain = rehearse(study)
    tick = dice.choice(ticks_of(plain, 2)[2:])
    stalls = {tick: LIMIT_S + dice.uniform(0.01, 6.0)}
    if seed:  # the loop stalls again while it catches up
        stalls[tick + dice.randint(1, 50)] = LIMIT_S + dice.uniform(0.01, 6.0)
    seen = rehearse(study, clock=StallingClock(stalls))
    assert outcomes(seen) == [(2, 1, "interrupted"), (2, 2, "success"), (3, 1, "success")]
    assert [event.data["seconds"] for event in seen.events("loop.stalled")] == pytest.approx(
        list(stalls.values()), abs=0.01
    )
    held = missed(seen.frames, stalls)
    assert len(held) >= sum(stalls.values()) * 240 - len(stalls)
    assert all(frame.paused and not frame.command[ANGLES].any() for frame in held)
    assert np.ptp([frame.state[ANGLES] for frame in held], axis=0).max() == 0.0
    again = next(frame for frame in seen.frames[tick + 1 :] if frame.trial == 2)
    assert again.tick.due > held[-1].tick.due, "it begins when no missed tick is left"


@pytest.mark.parametrize("waits", [True, False])
def test_a_trial_that_stalls_in_each_attempt_is_not_repeated_for_ever(
    study: Study, *, waits: bool
) -> None:
    """A task that took 0.3 s once in each attempt made 152 attempts of one trial in a minute."""
    stalls = dict.fromkeys(range(100, 40_000, 90), 0.3)
    start = {tick: [Command(Order.START)] for tick in (10, 20, 30)}
    orders = start | {12_000: [Command(Order.END)]} if waits else {}
    seen = rehearse(study, orders, waits=waits, clock=StallingClock(stalls))
    ends = [event.data["outcome"] for event in seen.events("trial.end")]
    assert ends.count("interrupted") == 3
    if waits:
        assert [event.data["by"] for event in seen.events("pause.start")] == ["examiner"]
    else:
        (end,) = seen.events("session.end")
        assert "it stalled again and again in one trial" in str(end.data)


def test_ticks_that_are_late_by_less_than_the_limit_catch_up(study: Study) -> None:
    plain = rehearse(study)
    dice = random.Random(4)
    late = {dice.randrange(len(plain.frames)): dice.uniform(0.0, 0.24) for _ in range(5)}
    seen = rehearse(study, clock=StallingClock(late))
    assert "loop.stalled" not in seen.names
    assert outcomes(seen) == outcomes(plain)
    np.testing.assert_array_equal(
        [frame.state for frame in seen.frames], [frame.state for frame in plain.frames]
    )


def test_a_slow_computer_stalls_nothing_however_late_it_gets(study: Study) -> None:
    late = dict.fromkeys(range(5000), 0.01)  # each tick takes 2.4 periods
    seen = rehearse(study, clock=StallingClock(late))
    assert max(frame.tick.late_s for frame in seen.frames) > 4 * LIMIT_S
    assert {outcome for *_, outcome in outcomes(seen)} == {"success"}


def test_the_protocols_limit_says_what_a_stall_is(tmp_path: Path) -> None:
    study = a_study(tmp_path)
    limited = study.protocol.presented.model_copy(update={"max_gap_s": 0.1})
    strict = replace(study, protocol=study.protocol.model_copy(update={"presented": limited}))
    tick = ticks_of(rehearse(study), 2)[20]
    clocks = [StallingClock({tick: 0.15}) for _ in range(2)]
    assert outcomes(rehearse(study, clock=clocks[0]))[0] == (2, 1, "success")
    assert outcomes(rehearse(strict, clock=clocks[1]))[0] == (2, 1, "interrupted")


def test_a_session_that_goes_on_after_a_death_goes_on_after_a_stall(study: Study) -> None:
    rule = OnFault(session_died="continue")
    study = replace(study, protocol=study.protocol.model_copy(update={"on_fault": rule}))
    tick = ticks_of(rehearse(study), 2)[20]
    seen = rehearse(study, clock=StallingClock({tick: 1.0}))
    assert outcomes(seen) == [(2, 1, "interrupted"), (3, 1, "success")]
    (end,) = seen.events("session.end")
    assert (end.data["reason"], end.data["owed"]) == (
        "incomplete", "step 1: block 'aiming', trial 2"
    )  # fmt: skip


def test_a_trial_begins_when_the_ticks_missed_before_it_have_passed(study: Study) -> None:
    """Its start, and the end of a pause, were ordered while the session stalled."""
    plain = rehearse(study, {60: [Command(Order.START)]}, waits=True)
    start = next(n for n, frame in enumerate(plain.frames) if "trial.start" in names_of(frame))
    stalls = {60: 2.0}
    seen = rehearse(study, {60: [Command(Order.START)]}, waits=True, clock=StallingClock(stalls))
    held = missed(seen.frames, stalls)
    assert not any(frame.trial for frame in held)
    assert outcomes(seen) == outcomes(plain)
    pause = {start + 50: [Command(Order.PAUSE)], start + 90: [Command(Order.START)]}
    orders = {60: [Command(Order.START)], **pause}
    stalls = {start + 90: 2.0}
    seen = rehearse(study, orders, waits=True, clock=StallingClock(stalls))
    held = missed(seen.frames, stalls)
    assert all(frame.trial and frame.paused for frame in held)
    assert np.ptp([frame.state[ANGLES] for frame in held], axis=0).max() == 0.0
    assert outcomes(seen) == outcomes(plain), "nothing moved when it stalled"


def names_of(frame: Frame) -> list[str]:
    return [event.name for event in frame.events]


@pytest.mark.slow
def test_a_recording_with_stalls_is_replayed_bit_for_bit(
    study: Study, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    dice = random.Random(7)
    plain = rehearse(study)
    ticks = sorted(dice.sample(range(ticks_of(plain, 2)[2], len(plain.frames) - 20), 2))
    stalls = {tick: LIMIT_S + dice.uniform(0.01, 3.0) for tick in ticks}
    monkeypatch.setattr(session_module, "_clock", lambda *_: StallingClock(stalls))
    visit = Visit(study, "P001", 1, tmp_path / "data", simulated=True, fast=True)
    path = run(visit, QueueConsole())
    session = open_recording(path).session(1)
    assert (session.events["name"] == "loop.stalled").sum() == len(stalls)
    assert "interrupted" in set(session.trials["outcome"])
    assert session.trials.query("outcome == 'success'")["trial"].tolist() == [2, 3]
    again = replay_session(path, 1)
    assert again.difference is None
    assert again.ticks == len(session.streams["state"].time)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_a_session_that_stalls_and_then_dies_is_completed_with_each_trial_done_once(
    study: Study, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seed: int
) -> None:
    dice = random.Random(seed)
    into, stall_s = dice.randint(5, 60), LIMIT_S + dice.uniform(0.05, 1.0)
    tick = ticks_of(rehearse(study), 2)[into]
    clock = session_module._clock

    def stalling(visit: Visit, so_far: Progress | None) -> Clock:
        return StallingClock({tick: stall_s}) if so_far is None else clock(visit, so_far)

    monkeypatch.setattr(session_module, "_clock", stalling)
    visit = Visit(study, "P001", 1, tmp_path / "data", simulated=True, fast=True)
    # While ticks are caught up, or in the attempt that follows.
    dies = into + dice.choice([round(stall_s * 120), round(stall_s * 240) + 30])
    with pytest.raises(DiesError):
        run(visit, DiesInTrial(2, dies))
    path = run(replace(visit, resumed=True), QueueConsole())
    trials = open_recording(path).session(1).trials
    assert trials.query("outcome == 'success'")["trial"].tolist() == [2, 3]
    assert trials.query("trial == 2")["attempt"].tolist() == list(
        range(1, 1 + (trials["trial"] == 2).sum())
    )
    assert set(trials["outcome"]) == {"interrupted", "success"}
