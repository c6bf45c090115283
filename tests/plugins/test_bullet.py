"""All cranes: their contract, and the law by which their joints move."""

import numpy as np
import pytest
from cranes import (
    build,
    cranes,
    drive,
    machines,
    needs_bullet,
    needs_mujoco,
    random_sticks,
    rates,
    standing,
)

from labcrane import Dynamics
from labcrane.machines import Arm, jacobian, load_machine
from labcrane.testing import RATE_HZ, DynamicsContract, ch8, crane_state


class TestKinematicCrane(DynamicsContract):
    @pytest.fixture
    def dynamics(self) -> Dynamics:
        return build("kinematic_crane", ch8())


class TestSluggishKinematicCrane(DynamicsContract):
    @pytest.fixture
    def dynamics(self) -> Dynamics:
        return build("kinematic_crane", ch8(), "sluggish")


@needs_bullet
class TestBulletCrane(DynamicsContract):
    @pytest.fixture
    def dynamics(self) -> Dynamics:
        return build("bullet_crane", ch8())


@needs_bullet
class TestHydraulicBulletCrane(DynamicsContract):
    @pytest.fixture
    def dynamics(self) -> Dynamics:
        return build("bullet_crane", ch8(), "hydraulic")


@needs_mujoco
class TestMujocoCrane(DynamicsContract):
    @pytest.fixture
    def dynamics(self) -> Dynamics:
        return build("mujoco_crane", ch8())


@needs_mujoco
class TestHydraulicMujocoCrane(DynamicsContract):
    @pytest.fixture
    def dynamics(self) -> Dynamics:
        return build("mujoco_crane", ch8(), "hydraulic")


BEYOND_DEG = {"kinematic_crane": 0.0, "bullet_crane": 0.1, "mujoco_crane": 1e-9}
"""How far beyond its limits a crane lets a joint: those of PyBullet are soft."""


@cranes
def test_cranes_have_the_state_that_everything_else_expects(name: str) -> None:
    expected = crane_state(ch8()).signals
    *first, load, saturated = (*build(name, ch8()).signals, None, None)[: len(expected) + 2]
    assert tuple(first) == expected
    names = [None, None] if name == "kinematic_crane" else ["joint.load", "joint.saturated"]
    assert [each and each.name for each in (load, saturated)] == names


@cranes
@machines
@rates
def test_a_held_command_gives_its_speed_within_a_thousandth(
    name: str, model: str, rate_hz: float
) -> None:
    machine = load_machine(model)
    centre = [0.0] * len(machine.joints)
    with standing(name, machine, rate_hz) as crane:
        for share in (-1.0, -0.3, 0.05, 0.6, 1.0):
            crane.reset(centre)
            command = share * np.array(machine.speeds)
            states = drive(crane, np.tile(command, (round(1.5 * rate_hz), 1)), rate_hz)
            steady = states[round(1.0 * rate_hz) :, 4:8]
            assert np.abs(steady / command - 1.0).max() < 0.001


@cranes
@machines
@rates
def test_a_crane_left_alone_does_not_sink(name: str, model: str, rate_hz: float) -> None:
    machine = load_machine(model)
    level = [0.0, *(-joint.offset for joint in machine.joints[1:])]
    stretched = np.clip(level, *np.array(machine.limits).T)  # where its weight pulls hardest
    with standing(name, machine, rate_hz) as crane:
        for pose in (machine.rest, tuple(stretched.tolist())):
            crane.reset(pose)
            states = drive(crane, np.zeros((round(10 * rate_hz), 4)), rate_hz)
            assert np.degrees(np.abs(states[:, :4] - pose)).max() < 0.001


@cranes
@machines
@rates
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_no_joint_is_driven_through_its_limit(
    name: str, model: str, rate_hz: float, sign: float
) -> None:
    machine = load_machine(model)
    lowest, highest = np.array(machine.limits).T
    with standing(name, machine, rate_hz) as crane:
        command = sign * np.array(machine.speeds)
        states = drive(crane, np.tile(command, (round(10 * rate_hz), 1)), rate_hz)
        beyond = np.maximum(states[:, :4] - highest, lowest - states[:, :4])
        assert np.degrees(beyond).max() <= BEYOND_DEG[name]
        at_end = np.where(sign > 0, highest, lowest)
        assert np.degrees(np.abs(states[-1, :4] - at_end)).max() < 0.1, "all joints get there"
        assert np.abs(states[-1, 4:8] / command).max() < 0.01, "and stay"


@pytest.mark.slow
@needs_mujoco
@machines
@rates
def test_end_stops_bear_whatever_a_drive_cannot_stop(model: str, rate_hz: float) -> None:
    """Full speed from anywhere, and back: 0.1 degrees were allowed, 1e-9 is rounding."""
    machine = load_machine(model)
    lowest, highest = np.array(machine.limits).T
    random = np.random.default_rng(18)
    with standing("mujoco_crane", machine, rate_hz) as crane:
        hit = 0
        for pose in random.uniform(lowest, highest, (12, 4)):
            crane.reset(pose.tolist())
            ways = random.choice([-1.0, 1.0], (4, 4)) * machine.speeds
            states = drive(crane, np.repeat(ways, round(1.5 * rate_hz), axis=0), rate_hz)
            beyond = np.maximum(states[:, :4] - highest, lowest - states[:, :4])
            assert np.degrees(beyond).max() < 1e-9
            hit += int((beyond > -1e-9).any())
        assert hit > 6, "limits are run into"


def test_the_kinematic_crane_stops_exactly_at_its_limits_and_comes_back_at_once() -> None:
    machine = ch8()
    full = np.array(machine.speeds)
    with standing("kinematic_crane", machine) as crane:
        states = drive(crane, np.tile(full, (2400, 1)))
        np.testing.assert_array_equal(states[-1, :4], np.array(machine.limits)[:, 1])
        assert not states[-1, 4:8].any()
        assert not states[-1, 11:14].any()
        back = crane.step(-full, 1 / RATE_HZ)
        np.testing.assert_array_equal(back[4:8], -full)


def test_the_kinematic_crane_integrates_its_commands_exactly() -> None:
    machine = ch8()
    commands = random_sticks(machine, RATE_HZ, 5.0)
    with standing("kinematic_crane", machine) as crane:
        crane.reset([0.0] * 4)
        states = drive(crane, commands)
    np.testing.assert_array_equal(states[:, 4:8], commands)
    angles = np.cumsum(commands, axis=0) / RATE_HZ
    np.testing.assert_allclose(states[:, :4], angles, rtol=0, atol=1e-14)


def test_a_lagging_crane_follows_the_closed_form() -> None:
    machine = ch8()
    full, lag = np.array(machine.speeds), 0.15
    with standing("kinematic_crane", machine, actuator={"lag_s": lag}) as crane:
        crane.reset([0.0] * 4)
        states = drive(crane, np.tile(full, (240, 1)))
    time = np.arange(1, 241) / RATE_HZ
    expected = np.outer(1 - np.exp(-time / lag), full)
    np.testing.assert_allclose(states[:, 4:8], expected, rtol=0, atol=1e-13)


@cranes
@machines
def test_the_tip_moves_as_the_jacobian_says(name: str, model: str) -> None:
    machine = load_machine(model)
    arm = Arm(machine)
    with standing(name, machine) as crane:
        for state in drive(crane, random_sticks(machine, RATE_HZ, 2.0)):
            angles, speeds = state[:4].tolist(), state[4:8]
            np.testing.assert_allclose(state[8:11], arm.tip(angles), rtol=0, atol=1e-12)
            moving = jacobian(machine, angles) @ speeds
            np.testing.assert_allclose(state[11:14], moving, rtol=0, atol=1e-12)
