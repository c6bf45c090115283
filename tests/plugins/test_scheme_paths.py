"""Where the tip goes under each scheme, near limits and far from them."""

import numpy as np
import pytest
from ideal_crane import IdealCrane
from scheme_setups import (
    LOW,
    MACHINES,
    end_effector,
    joint_velocity,
    push,
    ready,
)

from labcrane import Controller, FloatArray
from labcrane.testing import (
    RATE_HZ,
    ch8,
    crane_at,
)
from labcrane_schemes.end_effector import EndEffector
from labcrane_schemes.joint_velocity import JointVelocity


def drive(
    scheme: Controller, crane: IdealCrane, velocity: FloatArray, seconds: float
) -> FloatArray:
    """Steer for a while; return the path of the tip and the joint speeds used."""
    path, commands = [crane.tip.copy()], []
    for _ in range(round(seconds * RATE_HZ)):
        command = scheme.command(scheme.inverse(velocity, crane.state), crane.state)
        commands.append(command.copy())
        path.append(crane.step(command)[8:11].copy())
    return np.array(path), np.array(commands)


def cross_track(path: FloatArray, direction: FloatArray) -> float:
    """Return the largest distance in m from the line through the first point."""
    along = direction / np.linalg.norm(direction)
    moved = path - path[0]
    return float(np.linalg.norm(moved - np.outer(moved @ along, along), axis=1).max())


def test_a_soft_stop_slows_only_towards_the_limit() -> None:
    machine = ch8()
    scheme = ready(JointVelocity(joint_velocity(soft_stop_deg=5), machine), machine)
    for distance_deg, left in [(10, 1.0), (5, 1.0), (2.5, 0.5), (0.5, 0.1), (0, 0.0), (-1, 0.0)]:
        state = crane_at(machine, [machine.limits[0][1] - np.radians(distance_deg), 0, 0, 0])
        towards = scheme.command(push(left_x=1), state).copy()
        away = scheme.command(push(left_x=-1), state).copy()
        assert towards[0] == pytest.approx(left * machine.speeds[0], abs=1e-12)
        assert towards[5] == pytest.approx(left, abs=1e-12)
        assert away[0] == -machine.speeds[0]
        assert away[5] == 1.0


@pytest.mark.parametrize("scheme_class", [JointVelocity, EndEffector])
def test_no_joint_passes_its_limit_however_long_the_stick_is_held(scheme_class: type) -> None:
    machine = ch8()
    settings = joint_velocity() if scheme_class is JointVelocity else end_effector(speed_m_s=2.0)
    lowest, highest = np.array(machine.limits).T
    for sign in (-1.0, 1.0):
        scheme = ready(scheme_class(settings, machine), machine)
        crane = IdealCrane(machine, machine.rest)
        for _ in range(int(20 * RATE_HZ)):
            crane.step(scheme.command(np.full(6, sign), crane.state))
            assert (crane.angles >= lowest).all()
            assert (crane.angles <= highest).all()


@pytest.mark.parametrize("name", MACHINES)
def test_joint_speeds_stay_within_limits_when_driven_outward_at_full_extension(name: str) -> None:
    machine = MACHINES[name]
    scheme = ready(EndEffector(end_effector(), machine), machine)
    crane = IdealCrane(machine, LOW[name])
    path, commands = drive(scheme, crane, np.array([0.5, 0.0, 0.0]), 15.0)
    assert (np.abs(commands[:, :4]) <= np.array(machine.speeds) * (1 + 1e-12)).all()
    speed = np.linalg.norm(np.diff(path, axis=0), axis=1) * RATE_HZ
    assert speed[:240].mean() == pytest.approx(0.5, rel=0.01)
    assert speed[-240:].max() < 0.05, "at full reach the tip comes to rest"
    assert path[-1, 0] > path[0, 0] + 1.0


DIRECTIONS = {
    "out": (1, 0, 0),
    "in": (-1, 0, 0),
    "left": (0, 1, 0),
    "right": (0, -1, 0),
    "up": (0, 0, 1),
    "diagonal": (-1, 1, 0),
    "in space": (-1, -1, 1),
}


@pytest.mark.parametrize("name", MACHINES)
@pytest.mark.parametrize("direction", DIRECTIONS.values(), ids=DIRECTIONS)
@pytest.mark.parametrize("scheme_class", [EndEffector, JointVelocity])
def test_the_tip_follows_a_line_of_two_metres(
    name: str, direction: tuple[float, ...], scheme_class: type
) -> None:
    machine = MACHINES[name]
    settings = end_effector() if scheme_class is EndEffector else joint_velocity(expo=0.4)
    scheme = ready(scheme_class(settings, machine), machine)
    velocity = 0.5 * np.array(direction) / np.linalg.norm(direction)
    path, commands = drive(scheme, IdealCrane(machine, LOW[name]), velocity, 4.0)
    assert (commands[:, 4] == 1.0).all(), "the machine is fast enough for this line"
    ideal = path[0] + np.outer(np.arange(len(path)) / RATE_HZ, velocity)
    assert np.linalg.norm(path - ideal, axis=1).max() < 0.002


def test_uniform_scaling_keeps_the_direction_of_a_tip_that_is_asked_to_go_too_fast() -> None:
    machine = ch8()
    direction = np.array([-1.0, 1.0, 0.5]) / 1.5
    scheme = ready(EndEffector(end_effector(speed_m_s=4.0), machine), machine)
    path, commands = drive(scheme, IdealCrane(machine, LOW["ch8"]), 3.0 * direction, 1.5)
    assert commands[:, 4].max() < 0.7, "all of it is slowed"
    used = np.abs(commands[:, :4]) / machine.speeds
    np.testing.assert_allclose(used.max(axis=1), 1.0)
    assert np.linalg.norm(path[-1] - path[0]) > 0.8
    assert cross_track(path, direction) < 0.005


def test_cutting_single_joints_would_have_bent_the_same_path() -> None:
    machine = ch8()
    direction = np.array([-1.0, 1.0, 0.5]) / 1.5
    fast = machine.model_copy(
        update={"joints": tuple(j.model_copy(update={"speed_deg_s": 1e3}) for j in machine.joints)}
    )
    scheme = ready(EndEffector(end_effector(speed_m_s=4.0), fast), fast)
    crane = IdealCrane(machine, LOW["ch8"])
    path = [crane.tip.copy()]
    for _ in range(360):
        command = scheme.command(scheme.inverse(3.0 * direction, crane.state), crane.state)
        speeds = np.clip(command[:4], -np.array(machine.speeds), machine.speeds)
        path.append(crane.step(speeds)[8:11].copy())
    assert cross_track(np.array(path), direction) > 0.05


def test_a_joint_near_its_limit_hands_over_and_the_path_stays_straight() -> None:
    machine = ch8()
    scheme = ready(EndEffector(end_effector(), machine), machine)
    crane = IdealCrane(machine, np.radians([0.0, 10.0, 25.0, 79.0]))
    velocity = np.array([-0.4, 0.0, 0.0])
    path, commands = drive(scheme, crane, velocity, 5.0)
    assert commands[:, 8].min() < 0.3, "the wrist runs into its soft stop"
    assert np.degrees(crane.angles[3]) < 86.0
    assert np.linalg.norm(path[-1] - path[0]) == pytest.approx(2.0, abs=0.01)
    assert cross_track(path, velocity) < 0.002
