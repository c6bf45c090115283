"""The arm that moves by a model: its speeds, its overloads, its scheme."""

import math

import numpy as np
import pytest
from cranes import needs_bullet
from dmd_arms import MAP, MODEL, RETRIEVAL, build, standing, step

import labcrane_dmd
from labcrane import Controller, Dynamics, ProtocolError, Signal
from labcrane.machines import Arm, load_machine
from labcrane.testing import (
    RATE_HZ,
    CommandContract,
    ControllerContract,
    DynamicsContract,
    ch8,
    crane_at,
    make_run,
)
from labcrane_dmd import labcrane_commands
from labcrane_dmd.arm.overload import Overload
from labcrane_dmd.arm.settings import ArmSettings, OverloadSettings, ValveSettings
from labcrane_dmd.arm.valve import Valve
from labcrane_dmd.fit.recordings import read_recordings

pytestmark = needs_bullet


class TestDmdArm(DynamicsContract):  # "dmd_arm"
    @pytest.fixture
    def dynamics(self) -> Dynamics:
        return build(ch8(), proportional=ch8().names, jaws=None)


class TestValve(ControllerContract):  # "valve"
    @pytest.fixture
    def controller(self) -> Controller:
        return Valve(ValveSettings(map=MAP), ch8())


class TestCommands(CommandContract):
    @pytest.fixture(params=labcrane_commands(), ids=lambda offered: " ".join(offered.words))
    def command(self, request):
        return request.param


@pytest.mark.parametrize("name", ["arm", "boom", "jaws"])
@pytest.mark.parametrize("signal", [-220, -140, -100, -60, 60, 100, 140, 220])
def test_the_arm_moves_at_the_models_speed(name: str, signal: int) -> None:
    model = labcrane_dmd.load(MODEL)
    machine = load_machine("ied_arm.yaml", RETRIEVAL)
    joint = machine.names.index(name)
    lowest, highest = machine.limits[joint]
    pose = list(machine.rest)
    pose[joint] = lowest + (0.1 if signal > 0 else 0.9) * (highest - lowest)
    with standing() as (arm, state):
        arm.reset(pose)
        step(arm, 1.3, **{name: signal})
        angle, velocity = (
            state.find(f"joint.{what}").start + joint for what in ("angle", "velocity")
        )
        before = arm.state()[angle]
        for after in step(arm, 1.0, **{name: signal}):
            assert after[velocity] == pytest.approx(model[name].speed(signal, before), rel=0.005)
            before = after[angle]


@pytest.mark.long
def test_the_arm_needs_the_recorded_time_to_its_far_end() -> None:
    machine = load_machine("ied_arm.yaml", RETRIEVAL)
    compared = 0
    with standing() as (arm, state):
        for recording in read_recordings(RETRIEVAL / "hydraulic_arm"):
            joint = machine.names.index(recording.name)
            column = state.find("joint.angle").start + joint
            for run in recording.runs:
                size, sign = abs(run.signal), math.copysign(1.0, run.signal)
                end = max(sign * other.angle[-1] for other in recording.runs)
                arrived = sign * run.angle[-1] > end - math.radians(0.3)
                if size not in (100, 140, 180, 220) or not arrived:
                    continue
                pose = list(machine.rest)
                lowest, highest = machine.limits[joint]
                pose[joint] = min(max(float(np.mean(run.angle[: run.step])), lowest), highest)
                arm.reset(pose)
                # To half a degree before the end: there noise does not decide when it was reached.
                there = sign * (end - math.radians(0.5))
                passed = int(np.argmax(sign * (run.angle - there) >= 0.0))
                seconds = run.time[passed] - run.time[run.step]
                ticks, command = 0, np.zeros(4)
                command[joint] = run.signal
                while (
                    sign * (arm.state()[column] - there) < 0.0 and ticks < 1.1 * seconds * RATE_HZ
                ):
                    arm.step(command, 1 / RATE_HZ)
                    ticks += 1
                assert ticks / RATE_HZ == pytest.approx(seconds, rel=0.02), (
                    recording.name,
                    run.signal,
                )
                compared += 1
    assert compared >= 20


def test_an_end_of_the_range_overloads_in_the_direction_of_the_drive() -> None:
    machine = load_machine("ied_arm.yaml", RETRIEVAL)
    with standing() as (arm, state):
        over, at_end = state.index("joint.overload.boom"), state.index("joint.end.boom")
        for signal, end in ((200.0, 1.0), (-200.0, -1.0)):
            pose = list(machine.rest)
            lowest, highest = machine.limits[2]
            pose[2] = highest - 0.05 if end > 0 else lowest + 0.05
            arm.reset(pose)
            went = step(arm, 2.0, boom=signal)
            assert went[-1][over] == end == went[-1][at_end]
            assert set(went[:, over]) == {0.0, end}
            angles = went[:, state.index("joint.angle.boom")]
            assert lowest - 1e-3 < angles.min() <= angles.max() < highest + 1e-3
            back = step(arm, 1.5, boom=0.0)
            assert back[-1][over] == 0.0


def test_a_load_that_trembles_around_its_limit_is_one_overload() -> None:
    watch = Overload(OverloadSettings(limit=0.9, release=0.8, hold_s=0.2), 1 / RATE_HZ)
    loads = [0.95, 0.85, 0.7, 0.95] * 200 + [0.5] * 49 + [0.95, -0.95, *([-0.95] * 60)]
    seen = [watch.see(load, driven=True) for load in loads]
    changes = [now for before, now in zip([0, *seen], seen, strict=False) if now != before]
    assert changes == [1, 0, 1, -1]


def test_a_joint_without_a_law_is_refused() -> None:
    with pytest.raises(
        ProtocolError, match=r"joint 'base' is not in the model, which has arm, boom"
    ):
        build(proportional=())


def test_a_joint_that_was_not_recorded_has_the_valve_of_those_that_were() -> None:
    """Dead band, dead time and lag are the means of the model's, written here by hand."""
    ways = [
        way for each in labcrane_dmd.load(MODEL).values() for way in (each.extend, each.retract)
    ]
    time, lag = (np.mean([getattr(way, name) for way in ways]) for name in ("dead_time", "lag"))
    with standing() as (arm, state):
        base, full = state.index("joint.velocity.base"), arm._machine.speeds[0]
        assert not step(arm, 10.0, base=2.5)[:, base].any(), "a stick 1 % off centre"
        speeds = step(arm, 1.5, base=250)[:, base]
    since = (np.arange(len(speeds)) + 1 - round(time * RATE_HZ)) / RATE_HZ
    band = np.mean([way.dead_band for way in ways]) / 250
    opening = np.maximum(0.0, 1.0 - np.exp(-np.maximum(since, 0.0) / lag))
    open_enough = opening * (1.0 - band) * 250 > 1.0
    np.testing.assert_allclose(speeds[open_enough], full * opening[open_enough], atol=1e-6)
    assert np.diff(speeds).max() < 0.05 * full, "no tick jumps"


def test_a_valve_that_is_given_is_taken() -> None:
    none = {"dead_band": 0.0, "dead_time_s": 0.0, "lag_s": 0.0}
    with standing(proportional_valve=none) as (arm, state):
        speeds = step(arm, 0.1, base=125)[:, state.index("joint.velocity.base")]
        np.testing.assert_allclose(speeds, 0.5 * arm._machine.speeds[0], atol=1e-6)


def test_a_record_without_a_valve_of_proportional_joints_had_none() -> None:
    written = {"model": MODEL, "proportional": ["base"]}
    found = ArmSettings.model_validate(written, context={"recorded": True, "folder": RETRIEVAL})
    assert found.proportional_valve is not None
    assert found.proportional_valve.numbers == (0.0, 0.0, 0.0)
    assert ArmSettings.model_validate(written).proportional_valve is None


def test_a_practised_hand_asks_for_the_speed_that_the_model_gives() -> None:
    machine = load_machine("ied_arm.yaml", RETRIEVAL)
    valve = Valve(ValveSettings(model=MODEL), machine)
    axes = (Signal("valve", "1", machine.names),)
    run = make_run(machine, axes=axes, command=valve.signals)
    valve.open(run)
    model = labcrane_dmd.load(MODEL)
    angles = [0.2, 0.3, -0.1, 0.5]
    state = crane_at(machine, angles)
    wanted = np.array([0.03, 0.04, -0.05])
    signals = 250 * valve.inverse(wanted, state)
    speeds = [
        model.proportional(machine.joints[0]).speed(signals[0], angles[0]),
        model["arm"].speed(signals[1], angles[1]),
        model["boom"].speed(signals[2], angles[2]),
        0.0,
    ]
    step_s = 1e-5
    moved = [angle + step_s * speed for angle, speed in zip(angles, speeds, strict=True)]
    kinematics = Arm(machine)
    got = np.subtract(kinematics.tip(moved), kinematics.tip(angles)) / step_s
    np.testing.assert_allclose(got, wanted, atol=0.004)
