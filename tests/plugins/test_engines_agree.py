"""Two engines with the same sticks and the same load: joints and tip beside each other."""

import math

import numpy as np
import pytest
from cranes import MACHINES, drive, needs_bullet, needs_mujoco, standing

from labcrane import FloatArray, Machine
from labcrane.machines import load_machine
from labcrane.testing import RATE_HZ

pytestmark = [needs_bullet, needs_mujoco]

ENGINES = ("bullet_crane", "mujoco_crane")
RATED_KG = 1300.0
"""The wrist of ch8 holds 1320 kg stretched out level, all other drives of both machines more."""

STOP_DEG = 0.1
"""How far PyBullet's joints go through their stops; until one stands there engines are alike."""


def jerks(machine: Machine, random: np.random.Generator, seconds: float) -> FloatArray:
    """Return full-range commands that jump about twice a second, at times of single joints."""
    ticks, joints = round(seconds * RATE_HZ), len(machine.joints)
    commands = np.zeros((ticks, joints))
    at = 0
    while at < ticks:
        held = round(random.uniform(0.1, 0.8) * RATE_HZ)
        commands[at : at + held] = random.uniform(-1, 1, joints) * (random.random(joints) < 0.7)
        at += held
    return commands * machine.speeds


def both(
    machine: Machine, pose: FloatArray, commands: FloatArray, payload_kg: float, actuator: str
) -> tuple[FloatArray, FloatArray]:
    """Return the states of both engines, tick by tick."""
    hung = {"payload_kg": payload_kg} if payload_kg else {}
    found = []
    for name in ENGINES:
        with standing(name, machine, RATE_HZ, actuator, **hung) as crane:
            crane.reset(pose.tolist())
            found.append(drive(crane, commands))
    return found[0], found[1]


def apart(machine: Machine, one: FloatArray, other: FloatArray) -> tuple[float, float]:
    """Return the largest distance of joints in degrees and of tips in m."""
    joints = len(machine.joints)
    angles = np.degrees(np.abs(one[:, :joints] - other[:, :joints]))
    tip = slice(2 * joints, 2 * joints + 3)
    return angles.max(initial=0.0), np.linalg.norm(one[:, tip] - other[:, tip], axis=1).max(
        initial=0.0
    )


def free_ticks(machine: Machine, *runs: FloatArray) -> int:
    """Return how many ticks pass until a joint of any run stands at a stop."""
    lowest, highest = np.array(machine.limits).T
    room = math.radians(STOP_DEG)
    joints = len(machine.joints)
    at = [(run[:, :joints] < lowest + room) | (run[:, :joints] > highest - room) for run in runs]
    stopped = np.any(at, axis=(0, 2))
    return int(stopped.argmax()) if stopped.any() else len(stopped)


@pytest.mark.slow
@pytest.mark.parametrize("model", MACHINES)
@pytest.mark.parametrize("sticks", ["random", "none"])
def test_engines_are_alike_up_to_the_rated_load(model: str, sticks: str) -> None:
    random, machine = np.random.default_rng(), load_machine(model)
    shares, worst = [], np.zeros(4)
    for number in range(50):
        pose = 0.9 * random.uniform(*np.array(machine.limits).T)
        commands = jerks(machine, random, 3.0)
        if sticks == "none":
            commands[:] = 0.0
        payload = (0.0, random.uniform(0.0, RATED_KG))[number % 2]
        one, other = both(machine, pose, commands, payload, ("ideal", "hydraulic")[number // 2 % 2])
        free = free_ticks(machine, one, other)
        shares.append(free / len(one))
        found = (*apart(machine, one[:free], other[:free]), *apart(machine, one, other))
        worst = np.maximum(worst, found)
    assert np.mean(shares) > 0.5
    degrees, metres, with_stops_degrees, with_stops_metres = worst
    assert degrees < 0.01
    assert metres < 0.001
    assert with_stops_degrees < 0.4
    assert with_stops_metres < 0.02


def told(machine: Machine, states: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the loads of joints, and where their drives give all they have."""
    joints = len(machine.joints)
    first = 2 * joints + 6
    return states[:, first : first + joints], states[:, first + joints : first + 2 * joints]


@pytest.mark.parametrize("model", MACHINES)
@pytest.mark.parametrize("payload_kg", [0.0, 1300.0])
def test_both_record_the_same_loads_and_where_a_drive_gives_all_it_has(
    model: str, payload_kg: float
) -> None:
    """Of a drive that gives all it has, the joint has not the speed asked for; of others it has."""
    machine = load_machine(model)
    pose = np.radians([0.0, 20.0, 35.0, 50.0])
    # Each joint reversed at once, a second apart, and on its way back at rest again.
    speeds = np.repeat(np.kron(np.eye(4), np.array([[0.0], [0.6], [-0.6], [0.0]])), 60, axis=0)
    commands = speeds * machine.speeds
    runs = both(machine, pose, commands, payload_kg, "ideal")
    loads, saturated = zip(*(told(machine, run) for run in runs), strict=True)
    for run, load, all_of_it in zip(runs, loads, saturated, strict=True):
        as_asked = np.abs(run[:, 4:8] - commands) < 1e-6
        assert np.abs(load).max() <= 1.0 + 1e-9
        np.testing.assert_array_equal(all_of_it != 0.0, np.abs(load) >= 1.0 - 1e-9)
        assert as_asked[all_of_it == 0.0].mean() > 0.99
        assert (~as_asked)[all_of_it != 0.0].mean() > 0.5
        assert 0.0 < (all_of_it != 0.0).mean() < 0.3
    alike = saturated[0] == saturated[1]
    assert alike.mean() > 0.99
    calm = (saturated[0] == 0.0).all(axis=1) & alike.all(axis=1)
    assert np.abs(loads[0] - loads[1])[calm].max() < 0.05


@pytest.mark.parametrize("model", MACHINES)
@pytest.mark.parametrize("joint", range(4))
def test_a_joint_reversed_at_once_moves_no_joint_that_nobody_asked(model: str, joint: int) -> None:
    machine = load_machine(model)
    commands = np.zeros((round(1.0 * RATE_HZ), 4))
    commands[:, joint] = machine.speeds[joint]
    commands[round(0.5 * RATE_HZ) :, joint] *= -1.0
    pose = np.radians([0.0, 20.0, 35.0, 50.0])
    one, other = both(machine, pose, commands, 0.0, "ideal")
    for states in (one, other):
        still = np.delete(np.degrees(states[:, 4:8]), joint, axis=1)
        assert np.abs(still).max() < 1.0
    degrees, metres = apart(machine, one, other)
    assert degrees < 0.1
    assert metres < 0.01


@pytest.mark.slow
@pytest.mark.parametrize(("model", "payload_kg"), [("ch8", 3000.0), ("ch8_cranelike", 4000.0)])
def test_a_crane_sinks_alike_under_a_load_that_its_drives_cannot_hold(
    model: str, payload_kg: float
) -> None:
    """Until a joint is driven into its stop, which each engine models in its own way."""
    machine, random = load_machine(model), np.random.default_rng()
    stretched = np.radians([0.0, 0.0, 5.0, 10.0])
    drawn = [0.9 * random.uniform(*np.array(machine.limits).T) for _ in range(8)]
    for pose in (stretched, *drawn):
        one, other = both(machine, pose, np.zeros((round(3.0 * RATE_HZ), 4)), payload_kg, "ideal")
        free = free_ticks(machine, one, other)
        assert apart(machine, one[:free], other[:free])[1] < 1e-6
        if pose is stretched:
            assert abs(other[-1, 10] - one[-1, 10]) < 0.05
            assert one[0, 10] - one[-1, 10] > 1.0
