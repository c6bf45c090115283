"""Somebody who moves one joint after the other in the crane study, and whose times are true."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import labcrane
from labcrane.analysis import find_cohort, measures_of
from labcrane.testing import main

FOLDER = Path(__file__).parents[2] / "protocols" / "crane_pilot"
ONE_BY_ONE = '''\
"""Hands that bring one joint after the other to where it belongs, and halt in between."""

import numpy as np

from labcrane import InputDevice, Settings, Signal, hookimpl, offer
from labcrane.machines import reach

labcrane_api = 1
AXES = ("x", "y", "twist", "slider", "trigger", "connected")
STICKS = ((0, -1.0), (7, -1.0), (1, 1.0), (6, -1.0))  # of slew, shoulder, elbow and wrist
LOOK_S, HALT_S, PRESS_S = 0.35, 0.4, 0.1


class OneByOne(InputDevice):
    signals = (Signal("left", "1", AXES), Signal("right", "1", AXES))

    def __init__(self, machine):
        self._machine, self._hands = machine, None

    def open(self, run):
        self._angle, self._dt = run.state.find("joint.angle"), 1.0 / run.rate_hz
        self._trial = 0

    def begin_trial(self, trial):
        condition = trial.planned.condition
        goal = reach(self._machine, [condition[f"target_{axis}"] for axis in "xyz"])
        self._hands, self._trial = self._acts(goal), trial.number

    def _waits(self, seconds):
        for _ in range(round(seconds / self._dt)):
            yield None

    def _acts(self, goal):
        yield from self._waits(LOOK_S)
        for joint in (3, 2, 1, 0):  # the slew, which moves the tip fastest, comes last
            axis, sign = STICKS[joint]
            if abs(goal[joint] - self._seen[joint]) < 0.05:
                continue
            while abs(push := np.clip(10.0 * (goal[joint] - self._seen[joint]), -0.9, 0.9)) > 0.12:
                yield axis, sign * push
            yield from self._waits(HALT_S)
        for _ in range(round(PRESS_S / self._dt)):
            yield 10, 1.0

    def read(self, tick, seen):
        out = np.zeros(12)
        out[[5, 11]] = 1.0
        if self._hands is None or seen.trial != self._trial:
            return out
        self._seen = seen.state[self._angle]
        act = next(self._hands, None)
        if act is not None:
            out[act[0]] = act[1]
        return out


@hookimpl
def labcrane_inputs():
    return [offer("one_by_one", Settings, lambda settings, machine: OneByOne(machine))]
'''
RATE_HZ = 60.0


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the data folder of one session of the crane study, of two of its distances."""
    folder = tmp_path_factory.mktemp("one_by_one")
    text = (FOLDER / "protocol.yaml").read_text(encoding="utf-8")
    for before, after in (
        ("rate_hz: 240", f"rate_hz: {RATE_HZ:g}"),
        ("mujoco_crane, actuator: ideal", "kinematic_crane"),
        ("input: {use: dual_joystick}", "input: {use: dual_joystick}\noperator: {use: one_by_one}"),
        ("distances: [2, 3, 4, 6]", "distances: [2, 6]"),
        ("    movements: 4", "    movements: 2"),
    ):
        assert before in text
        text = text.replace(before, after)
    (folder / "protocol.yaml").write_text(text, encoding="utf-8")
    (folder / "instructions.md").write_text("Move.", encoding="utf-8")
    (folder / "plugins").mkdir()
    (folder / "plugins" / "one_by_one.py").write_text(ONE_BY_ONE, encoding="utf-8")
    data = folder / "data"
    run = ["run", str(folder / "protocol.yaml"), "--participant", "P001", "--simulate", "--fast"]
    assert main([*run, "--data", str(data)]) == 0
    return data


def hands(data: Path) -> pd.DataFrame:
    """Return of each trial when sticks were first used, the tap came, and where hands halted."""
    session = labcrane.open_recording(next(data.glob("P001*/*.h5"))).session(1)
    loop, sticks = (session.streams[name].data for name in ("loop", "input"))
    used = sticks[["left.x", "left.y", "right.x", "right.y"]].abs().to_numpy().max(axis=1) > 0.05
    rows = []
    for row in session.trials.itertuples():
        own = loop["trial"].to_numpy() == row.trial
        elapsed, on = loop["elapsed"].to_numpy()[own], used[own]
        first, last = np.flatnonzero(on)[[0, -1]]
        off = np.flatnonzero(np.diff(on[first : last + 1].astype(int)) == -1)
        again = np.flatnonzero(np.diff(on[first : last + 1].astype(int)) == 1)
        pressed = np.flatnonzero(sticks["right.trigger"].to_numpy()[own] > 0.5)[-1]
        rows.append((elapsed[first], elapsed[pressed], len(off), (again - off).sum() / RATE_HZ))
    return pd.DataFrame(rows, columns=["first", "tap", "halts", "halt_time"])


@pytest.mark.slow
def test_a_person_who_moves_joint_after_joint_has_the_times_of_all_strokes(recorded: Path) -> None:
    found = measures_of(find_cohort(recorded, ["simulated"]).included[0])
    true = hands(recorded)
    assert len(found) == 8
    assert (found["outcome"] == "success").all()
    whole = true["tap"] - true["first"]
    assert whole.mean() > 5.0
    np.testing.assert_allclose(found["movement_time"], whole, atol=2.5 / RATE_HZ)
    np.testing.assert_allclose(found["reaction_time"], true["first"], atol=1e-9)
    np.testing.assert_allclose(found["movement_onset"], true["first"], atol=2.5 / RATE_HZ)
    assert (true["halts"] >= 2).all()
    np.testing.assert_array_equal(found["halts"], true["halts"])
    np.testing.assert_allclose(found["halt_time"], true["halt_time"], atol=0.05)
    assert (found["main_stroke_time"] < 0.7 * found["movement_time"]).all()
    assert (found["path_ratio"] > 1.05).all()
    assert (found["bimanual"] < 0.01).all()


def test_the_event_of_an_onset_is_at_the_onset_and_says_how_late_it_was_told(
    recorded: Path,
) -> None:
    session = labcrane.open_recording(next(recorded.glob("P001*/*.h5"))).session(1)
    events = session.events
    onsets = events[events["name"] == "movement.onset"]
    for row in session.trials.itertuples():
        (event,) = (e for e in onsets.itertuples() if e.trial == row.trial)
        assert event.time == pytest.approx(row.started + row.movement_onset)
        assert event.data["delay_s"] == pytest.approx(0.1, abs=1e-6)
        assert event.tick / RATE_HZ == pytest.approx(event.time + 0.1, abs=1e-6)
