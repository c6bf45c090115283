"""Payload and swinging grapple: against pendulums and levers worked out by hand."""

import math
from pathlib import Path

import numpy as np
import pytest
from cranes import build, drive, engines, needs_bullet, needs_mujoco, random_poses, standing
from rehearsal import SHORT, a_study, loaded
from results.recorded import record

from labcrane import Dynamics, FloatArray, ProtocolError, open_recording
from labcrane.machines import Arm, link_frames
from labcrane.replay import replay_session
from labcrane.testing import RATE_HZ, DynamicsContract, ch8

GRAVITY = 9.81
MACHINE = ch8()
GRAPPLE = {"mass_kg": 150.0, "length_m": 1.2, "size_m": 0.5, "damping": 0.0}
ARM = (1.2**2 + 0.5**2 / 6.0) / 1.2
"""Of a pendulum that is a cube: its squared radius of gyration about the hinge, over length."""


@needs_bullet
class TestBulletPayload(DynamicsContract):
    @pytest.fixture
    def dynamics(self) -> Dynamics:
        return build("bullet_crane", MACHINE, payload_kg=100.0)


@needs_bullet
class TestBulletGrapple(DynamicsContract):
    @pytest.fixture
    def dynamics(self) -> Dynamics:
        return build("bullet_crane", MACHINE, "hydraulic", payload_kg=100.0, grapple={})


@needs_mujoco
class TestMujocoPayload(DynamicsContract):
    @pytest.fixture
    def dynamics(self) -> Dynamics:
        return build("mujoco_crane", MACHINE, payload_kg=100.0)


@needs_mujoco
class TestMujocoGrapple(DynamicsContract):
    @pytest.fixture
    def dynamics(self) -> Dynamics:
        return build("mujoco_crane", MACHINE, "hydraulic", payload_kg=100.0, grapple={})


def found(crane: Dynamics, states: FloatArray, name: str) -> FloatArray:
    columns = [column for signal in crane.signals for column in signal.columns]
    return states[..., columns.index(name)]


def swung(crane: Dynamics, joint: int, seconds: float) -> FloatArray:
    """Give the crane a short jerk in one joint, and return what it does when it stands again."""
    command = np.zeros(4)
    command[joint] = 0.1
    drive(crane, np.tile(command, (round(0.3 * RATE_HZ), 1)))
    return drive(crane, np.zeros((round(seconds * RATE_HZ), 4)))


def period(angle: FloatArray) -> float:
    """Return the mean period, from upward crossings of zero between ticks."""
    (before,) = np.nonzero((angle[:-1] < 0.0) & (angle[1:] >= 0.0))
    crossed = before - angle[before] / (angle[before + 1] - angle[before])
    return float(np.diff(crossed).mean() / RATE_HZ)


@engines
@pytest.mark.parametrize(("joint", "way"), [(1, "along"), (0, "across")])
@pytest.mark.parametrize("payload_kg", [0.0, 400.0])
def test_a_grapple_swings_with_the_period_of_a_pendulum(
    name: str, joint: int, way: str, payload_kg: float
) -> None:
    with standing(name, MACHINE, payload_kg=payload_kg, grapple=GRAPPLE) as crane:
        swing = found(crane, swung(crane, joint, 20.0), f"grapple.swing.{way}")
    assert math.radians(0.3) < np.abs(swing).max() < math.radians(8.0)
    assert period(swing) == pytest.approx(2.0 * math.pi * math.sqrt(ARM / GRAVITY), rel=0.01)
    assert np.abs(swing[-480:]).max() == pytest.approx(np.abs(swing[:960]).max(), rel=0.05)


@engines
def test_damping_takes_a_swing_away_as_it_should(name: str) -> None:
    damping, about = 40.0, 150.0 * ARM * 1.2
    with standing(name, MACHINE, grapple={**GRAPPLE, "damping": damping}) as crane:
        swing = found(crane, swung(crane, 1, 20.0), "grapple.swing.along")
    peaks = [at for at in range(1, len(swing) - 1) if swing[at - 1] < swing[at] >= swing[at + 1]]
    slope = np.polyfit(np.array(peaks) / RATE_HZ, np.log(swing[peaks]), 1)[0]
    assert slope == pytest.approx(-damping / (2.0 * about), rel=0.03)


@engines
def test_a_grapple_that_is_slewed_round_hangs_outward_by_the_centrifugal_force(name: str) -> None:
    turning = 0.4
    with standing(name, MACHINE, grapple={**GRAPPLE, "damping": 400.0}) as crane:
        crane.reset([-2.8, *MACHINE.rest[1:]])
        # Slowly up to speed: 6 s to get there, 7 s until nothing swings any more.
        ramp = np.minimum(turning, np.arange(round(13 * RATE_HZ)) / RATE_HZ / 6.0 * turning)
        last = drive(crane, np.outer(ramp, [1.0, 0.0, 0.0, 0.0]))[-1]
        out = found(crane, last, "grapple.swing.along")
        x, y = (found(crane, last, f"grapple.position.{axis}") for axis in "xy")
    radius = math.hypot(x - MACHINE.base_x, y)
    # Moments about the hinge; the cube's own products of inertia vanish.
    assert math.tan(out) == pytest.approx(turning**2 * radius / GRAVITY, rel=0.02)


@engines
@pytest.mark.parametrize("settings", [{"grapple": GRAPPLE}, {"payload_kg": 150.0}])
def test_what_hangs_loads_each_joint_by_its_lever(name: str, settings: dict[str, object]) -> None:
    for pose in random_poses(MACHINE, 5, seed=3).tolist():
        loads = []
        for hung in ({"payload_kg": 1e-6}, settings):
            with standing(name, MACHINE, **hung) as crane:
                crane.reset(pose)
                last = drive(crane, np.zeros((20, 4)))[-1]
                loads.append([found(crane, last, f"joint.load.{joint}") for joint in MACHINE.names])
        tip = link_frames(MACHINE, pose)[-1, :3, 3]
        for joint in (1, 2, 3):
            axis = link_frames(MACHINE, pose)[joint, :3, 3]
            lever = (tip - axis)[:2] @ np.array([math.cos(pose[0]), math.sin(pose[0])])
            torque = -150.0 * GRAVITY * lever  # positive pitch is down, so drives pull up
            got = (loads[1][joint] - loads[0][joint]) * MACHINE.joints[joint].effort
            assert got == pytest.approx(torque, rel=1e-3, abs=0.5)


@engines
def test_a_grapple_hangs_straight_down_wherever_the_crane_is_put(name: str) -> None:
    with standing(name, MACHINE, grapple=GRAPPLE) as crane:
        for pose in random_poses(MACHINE, 5).tolist():
            crane.reset(pose)
            for state in (crane.state().copy(), drive(crane, np.zeros((48, 4)))[-1]):
                below = np.subtract(Arm(MACHINE).tip(pose), (0.0, 0.0, 1.2))
                place = [found(crane, state, f"grapple.position.{axis}") for axis in "xyz"]
                np.testing.assert_allclose(place, below, atol=1e-3)


@engines
def test_a_grapple_is_drawn_where_and_as_it_hangs(name: str) -> None:
    """Its orientation turns straight down into the way from the tip to its centre."""
    with standing(name, MACHINE, grapple=GRAPPLE) as crane:
        crane.reset([0.7, -0.3, 0.4, 0.5])
        states = drive(crane, np.tile([0.2, 0.1, 0.0, 0.0], (120, 1)))
        for state in states[::10]:
            place = np.array([found(crane, state, f"grapple.position.{axis}") for axis in "xyz"])
            x, y, z, w = (found(crane, state, f"grapple.orientation.{axis}") for axis in "xyzw")
            down = -np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
            np.testing.assert_allclose(place, state[8:11] + 1.2 * down, atol=1e-12)
        assert {body.name for body in crane.bodies() if body.moves == "grapple"} == {
            "grapple",
            "grapple rod",
        }


@needs_mujoco
@pytest.mark.parametrize("settings", [{"payload_kg": 5e4}, {"payload_kg": 5e4, "grapple": {}}])
def test_a_load_too_heavy_for_the_drives_sinks_to_the_limits(settings: dict[str, object]) -> None:
    """Nothing is computed that is no number, whatever the limits have to bear."""
    with standing("mujoco_crane", MACHINE, **settings) as crane:
        states = drive(crane, np.zeros((round(10 * RATE_HZ), 4)))
    assert np.isfinite(states).all()
    assert states[-1, 10] < states[0, 10] - 1.0, "the tip is down"
    lowest, highest = np.degrees(np.array(MACHINE.limits).T)
    beyond = np.maximum(np.degrees(states[:, :4]) - highest, lowest - np.degrees(states[:, :4]))
    assert beyond.max() < 1e-9


@engines
def test_a_crane_without_load_is_the_crane_as_it_was(name: str) -> None:
    bare = {"bullet_crane": "BulletCrane", "mujoco_crane": "MujocoCrane"}
    assert type(build(name, MACHINE)).__name__ == bare[name]
    assert build(name, MACHINE).signals == build(name, MACHINE, payload_kg=100.0).signals


@pytest.mark.slow
@engines
@pytest.mark.parametrize("load", ["", ", payload_kg: 50, grapple: {}"])
def test_a_recorded_session_is_replayed_bit_for_bit(name: str, load: str, tmp_path: Path) -> None:
    text = SHORT.replace("kinematic_crane", name + load)
    path = record(a_study(tmp_path, text), tmp_path / "data", "P001", simulated=True)
    session = open_recording(path).session(1)
    again = replay_session(path, 1)
    assert again.difference is None
    assert again.parts == ()
    assert again.ticks == len(session.streams["state"].time) > 1000


STUDY = """\
labcrane: 1
study: load
title: A load
machine: ch8
input: {use: dual_joystick}
scheme: {use: joint_velocity, map: {slew: left.x, elbow: left.y, wrist: right.x, shoulder: right.y}}
dynamics: {use: kinematic_crane, payload_kg: 10}
tasks: {aiming: {use: aiming}}
sessions: [{name: only, steps: [{block: {task: aiming}}]}]
"""


def test_a_crane_without_masses_takes_no_load(tmp_path) -> None:
    (tmp_path / "study.yaml").write_text(STUDY, encoding="utf-8")
    said = r"study.yaml:7:34: 'payload_kg' is not a key of dynamics"
    with pytest.raises(ProtocolError, match=said):
        loaded(tmp_path / "study.yaml")
