"""A recorded session is shown frame by frame, with what happened, at any speed from any second."""

import random
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from faults.sessions import unique
from rehearsal import ScriptedConsole, a_study, simulated_file
from simple_crane import FORM

from labcrane import RecordingError, open_recording
from labcrane.core import SessionState
from labcrane.feedback.playback import played
from labcrane.recording.recorded_frames import RecordedFrames
from labcrane.streams.context import situation_after
from labcrane.testing import Command, Order, Visit, main, run

STUDY = (
    "labcrane: 1\nstudy: {study}\ntitle: Shown\nrate_hz: 60\n"
    + FORM.replace("dual_joystick", "simulated_operator")
    + "tasks:\n  aiming: {{use: aiming, distances: [3], movements: 2, limit_s: 20}}\n"
    "sessions:\n  - name: only\n    steps:\n      - block: {{task: aiming, pairs: 1}}\n"
)


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return simulated_file(tmp_path_factory.mktemp("shown"), STUDY.format(study=unique("shown")))


class Clock:
    """A clock that goes on when somebody waits, and a little when frames are sent."""

    def __init__(self, sending_s: float) -> None:
        self.time = 0.0
        self.sending_s = sending_s

    def now(self) -> float:
        return self.time

    def rest(self, seconds: float) -> None:
        self.time += seconds + self.sending_s


@pytest.mark.parametrize("speed", [0.1, 1.0, 7.0, 50.0])
def test_each_frame_is_shown_when_it_is_due_and_every_event_once(file: Path, speed: float) -> None:
    record = open_recording(file).session(1)
    reel = RecordedFrames(record)
    length = reel.time[-1] - reel.time[0]
    start = random.Random(speed).uniform(0.0, length / 2)
    clock = Clock(sending_s=0.001)
    state = record.streams["state"].data.to_numpy()
    happened, late = [], []
    for frame, events in played(reel, start, speed, clock.now, clock.rest):
        row = frame.tick.number - int(record.streams["loop"].data["tick"].iloc[0])
        np.testing.assert_array_equal(frame.state, state[row])
        due = (reel.time[row] - reel.time[0] - start) / speed
        late.append(clock.time - due)
        happened += events
    assert [event.name for event in happened] == record.events.sort_values("tick", kind="stable")[
        "name"
    ].tolist()
    assert clock.time == pytest.approx((length - start) / speed, abs=0.05)
    period = 1 / 60 / speed
    assert max(late[1:]) < 0.0011 + period, "no frame is shown after the next one was due"
    assert min(late) > -period


def test_the_first_frame_brings_what_the_session_was_about_then(file: Path) -> None:
    record = open_recording(file).session(1)
    reel = RecordedFrames(record)
    trials = record.trials
    middle = (trials["started"].iloc[1] + trials["ended"].iloc[1]) / 2 - reel.time[0]
    clock = Clock(0.0)
    frame, events = next(played(reel, middle, 1.0, clock.now, clock.rest))
    situation = SessionState()
    for event in events:
        situation = situation_after(situation, event)
    assert situation.trial == frame.trial == trials["trial"].iloc[1]


@pytest.mark.slow
def test_of_a_session_that_went_on_each_part_is_shown_with_its_own_events(tmp_path: Path) -> None:
    """Ticks are counted anew in each part."""
    visit = Visit(a_study(tmp_path), "P001", 1, tmp_path / "data", simulated=True, fast=True)
    run(visit, ScriptedConsole({900: [Command(Order.END)]}))
    file = run(replace(visit, resumed=True), ScriptedConsole())
    record = open_recording(file).session(1)
    assert sorted(set(record.events["part"])) == [1.0, 2.0]
    clock, situation, happened, trials = Clock(0.0), SessionState(), [], set()
    for frame, events in played(RecordedFrames(record), 0.0, 5.0, clock.now, clock.rest):
        for event in events:
            happened.append(event)
            situation = situation_after(situation, event)
        if frame.trial and not any(event.name == "trial.end" for event in events):
            assert (situation.trial, situation.over) == (frame.trial, "")
            trials.add(frame.trial)
    assert [event.name for event in happened] == record.events["name"].tolist()
    assert len(trials) > 1


def test_what_cannot_be_shown_is_said_in_words(
    file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    reel = RecordedFrames(open_recording(file).session(1))
    clock = Clock(0.0)
    with pytest.raises(RecordingError, match=r"lasts [\d.]+ s and has no second 1e\+06"):
        next(played(reel, 1e6, 1.0, clock.now, clock.rest))
    for words, said in (
        (["--show"], "neither views nor sounds"),
        (["--show", "--speed", "0"], "a speed of 0 is not possible"),
        (["--from", "3"], "--from needs --show; add it"),
    ):
        assert main(["replay", str(file), *words]) != 0
        told = capsys.readouterr()
        assert said in " ".join((told.out + told.err).split())
