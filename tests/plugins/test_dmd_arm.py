"""The arm that moves by a model: its speeds, its contacts, its overloads, its grip."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from cranes import needs_bullet

import labcrane_dmd
from labcrane import Arm, Controller, Dynamics, Planned, ProtocolError, Signal
from labcrane.machine_file import load_machine
from labcrane.testing import (
    RATE_HZ,
    ControllerContract,
    DynamicsContract,
    a_run,
    a_trial,
    ch8,
    crane_at,
)
from labcrane.testing.commands import CommandContract
from labcrane_dmd import labcrane_commands, labcrane_dynamics
from labcrane_dmd.arm_settings import ArmSettings, JawsSettings, OverloadSettings, ValveSettings
from labcrane_dmd.overload import Overload
from labcrane_dmd.recordings import read_recordings
from labcrane_dmd.valve import Valve

pytestmark = needs_bullet

RETRIEVAL = Path(__file__).parents[2] / "protocols" / "retrieval"
MODEL = RETRIEVAL / "arm.dmd.yaml"
MAP = {"slew": "left.x", "shoulder": "left.y", "elbow": "right.x", "wrist": "-right.y"}


def build(machine=None, **settings) -> Dynamics:
    (offered,) = labcrane_dynamics()
    machine = machine or load_machine("ied_arm.yaml", RETRIEVAL)
    given = {"model": MODEL, "proportional": ("base",), "jaws": JawsSettings()} | settings
    return offered.build(ArmSettings.model_validate(given), machine)


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


@contextmanager
def standing(scene: str | None = None, folder: Path | None = None, **settings) -> Iterator:
    """Yield an open arm in a scene, and what finds things in its state."""
    machine = load_machine("ied_arm.yaml", RETRIEVAL)
    if scene is not None and folder is not None:
        (folder / "scene.yaml").write_text(scene)
        settings["scenes"] = (folder / "scene.yaml",)
    arm = build(machine, **settings)
    signal = Signal("valve.signal", "1", machine.names)
    run = a_run(machine, command=(signal,), state=arm.signals)
    try:
        arm.open(run)
        if scene is not None:
            arm.begin_trial(a_trial(Planned({"scenario": "scene"}, expected_s=1.0)))
        yield arm, run.state
    finally:
        arm.close()


def step(arm: Dynamics, seconds: float, /, **signals: float) -> np.ndarray:
    """Hold signals; return the state after every tick."""
    order = ("base", "arm", "boom", "jaws")
    command = np.array([signals.get(name, 0.0) for name in order])
    return np.array(
        [arm.step(command, 1 / RATE_HZ).copy() for _ in range(round(seconds * RATE_HZ))]
    )


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


BLOCK = """\
labcrane_scene: 1
title: a block
things:
  block: {shape: box, size: [0.3, 0.3, 0.2], position: [1.6, 0, 0.1001], mass_kg: 20, limit_n: 100}
  ball: {shape: sphere, size: [0.2, 0.2, 0.2], position: [1.6, 1.2, 0.1001], mass_kg: 7}
goals: [{position: [0, 0, 0], radius: 1}]
"""


def test_things_at_rest_press_on_the_ground_with_their_weight(tmp_path: Path) -> None:
    with standing(BLOCK, tmp_path) as (arm, state):
        last = step(arm, 2.0)[-1]
        for name, mass in (("block", 20.0), ("ball", 7.0)):
            support = last[state.index(f"scene.{name}.support")]
            assert support == pytest.approx(mass * 9.81, rel=0.001)
            assert last[state.index(f"scene.{name}.force.{name}")] == 0.0


def test_force_is_impulse_over_the_window(tmp_path: Path) -> None:
    # A block falls by 0.2 m and comes to rest: its support, summed up, is all its momentum and
    # its weight for the whole time.
    scene = BLOCK.replace("0.1001], mass_kg: 20", "0.3], mass_kg: 20")
    with standing(scene, tmp_path) as (arm, state):
        support = step(arm, 2.0)[:, state.index("scene.block.support")]
        assert support.sum() / RATE_HZ == pytest.approx(20 * 9.81 * 2.0, rel=0.02)
        assert support.max() > 3 * 20 * 9.81  # the window is short enough to see the impact


def press_down(arm: Dynamics, state, stop: float) -> None:
    for _ in range(round(20 * RATE_HZ)):
        force = arm.step(np.array([0.0, 60.0, 0.0, 0.0]), 1 / RATE_HZ)[
            state.index("scene.block.force.block")
        ]
        if force > stop:
            return
    raise AssertionError("the arm never reached the block")


def over_the_block() -> list[float]:
    from labcrane import reach

    found = reach(load_machine("ied_arm.yaml", RETRIEVAL), (1.6, 0.0, 0.45))
    assert found is not None
    return [*found[:3], 0.0]


def test_pushing_is_felt_by_the_thing_and_by_the_joint(tmp_path: Path) -> None:
    with standing(BLOCK, tmp_path) as (arm, state):
        arm.reset(over_the_block())
        load = state.index("joint.load.arm")
        free = step(arm, 0.2)[-1][load]
        press_down(arm, state, 150.0)
        pushed = arm.state()[load]
        assert pushed > free + 0.02  # the drive now pushes down, where it held up before
        assert arm.state()[state.index("scene.block.support")] > 20 * 9.81 + 50


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


GRASP = """\
labcrane_scene: 1
title: something to hold
things:
  thing:
    {{shape: box, size: [0.08, 0.1, 0.2], position: [1.35, 0, 0.1001], mass_kg: 3, slip_n: {slip}}}
goals: [{{position: [0, 0, 0], radius: 1}}]
"""


def grasp(arm: Dynamics) -> None:
    from labcrane import reach

    found = reach(load_machine("ied_arm.yaml", RETRIEVAL), (1.35, 0.0, 0.15))
    assert found is not None
    arm.reset([*found[:3], math.radians(45)])
    step(arm, 9.0, jaws=-100)


def test_a_grip_forms_carries_and_is_let_go(tmp_path: Path) -> None:
    with standing(GRASP.format(slip=300), tmp_path) as (arm, state):
        held, height = state.index("grip.thing"), state.index("scene.thing.position.z")
        assert arm.state()[held] == 0.0
        grasp(arm)
        assert arm.state()[held] == 1.0
        lifted = step(arm, 3.0, arm=-120)
        assert lifted[-1][height] > 0.25
        assert lifted[-1][state.index("grip.force")] == pytest.approx(3 * 9.81, rel=0.3)
        let_go = step(arm, 3.0, jaws=150)
        assert let_go[-1][held] == 0.0
        assert let_go[-1][state.index("grip.drops")] == 0.0
        assert let_go[-1][height] < 0.2


def test_a_grip_breaks_above_the_slip_force_and_that_is_a_drop(tmp_path: Path) -> None:
    with standing(GRASP.format(slip=20), tmp_path) as (arm, state):
        grasp(arm)
        dropped = step(arm, 2.0, arm=-120)
        assert dropped[-1][state.index("grip.drops")] >= 1.0


def test_impossible_scenes_are_refused_in_words(tmp_path: Path) -> None:
    deep = BLOCK.replace("0.1001], mass_kg: 20", "0.02], mass_kg: 20")
    with (
        pytest.raises(
            ProtocolError,
            match=r"scene.yaml:4: 'block' is 0.080 m deep in the ground; its centre must be 0.100",
        ),
        standing(deep, tmp_path),
    ):
        pass
    inside = BLOCK.replace("[1.6, 1.2, 0.1001]", "[1.6, 0.1, 0.1001]")
    with (
        pytest.raises(ProtocolError, match=r"'ball' stands 0.\d+ m deep in 'block' at the start"),
        standing(inside, tmp_path),
    ):
        pass


def test_a_joint_without_a_law_is_refused() -> None:
    with pytest.raises(
        ProtocolError, match=r"joint 'base' is not in the model, which has arm, boom"
    ):
        build(proportional=())


def test_a_practised_hand_asks_for_the_speed_that_the_model_gives() -> None:
    machine = load_machine("ied_arm.yaml", RETRIEVAL)
    valve = Valve(ValveSettings(model=MODEL), machine)
    axes = (Signal("valve", "1", machine.names),)
    run = a_run(machine, axes=axes, command=valve.signals)
    valve.open(run)
    model = labcrane_dmd.load(MODEL)
    angles = [0.2, 0.3, -0.1, 0.5]
    state = crane_at(machine, angles)
    wanted = np.array([0.03, 0.04, -0.05])
    signals = 250 * valve.steer(wanted, state)
    speeds = [
        signals[0] / 250 * machine.speeds[0],
        model["arm"].speed(signals[1], angles[1]),
        model["boom"].speed(signals[2], angles[2]),
        0.0,
    ]
    step_s = 1e-5
    moved = [angle + step_s * speed for angle, speed in zip(angles, speeds, strict=True)]
    kinematics = Arm(machine)
    got = np.subtract(kinematics.tip(moved), kinematics.tip(angles)) / step_s
    np.testing.assert_allclose(got, wanted, atol=0.004)
