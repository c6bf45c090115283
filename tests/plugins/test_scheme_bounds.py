"""The resolved-rate law near limits and singularities: bounds, leaps and freezes."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from needs import needs
from scheme_setups import BASE, MACHINES, end_effector, ready
from scipy.optimize import linprog, lsq_linear

from labcrane import FloatArray, Machine
from labcrane.machines import jacobian
from labcrane.testing import RATE_HZ
from labcrane_schemes import law
from labcrane_schemes.end_effector import EndEffector

LEAP_M_S = 0.1
"""Change of the tip's velocity in a tick while the sticks are held, in m/s: 24 m/s² at 240 Hz, for
full speeds of 1 m/s per axis."""
SOFT = math.radians(5.0)
RIGS = {
    f"{name} {joints}": (machine, joints)
    for name, machine in MACHINES.items()
    for joints in (4, 3, 2)
}


def rigged(rig: str) -> tuple[Machine, list[float]]:
    """Return a machine with so many of its joints, and the block of its scheme."""
    machine, joints = RIGS[rig]
    machine = machine.model_copy(update={"joints": machine.joints[:joints]})
    for name in machine.__dict__.keys() - type(machine).model_fields.keys():
        del machine.__dict__[name]  # what was computed of all joints
    settings = end_effector(map=BASE, speed_m_s=1.0)
    scheme = ready(EndEffector(settings, machine), machine)
    assert isinstance(scheme, EndEffector)
    return machine, scheme.law


def drawn(machine: Machine, random: np.random.Generator, ticks: int) -> FloatArray:
    """Return poses, shape ``(ticks, n_joints)``: anywhere, at a limit or near one, arm straight."""
    low, high = np.transpose(machine.limits)
    size = (ticks, len(low))
    anywhere = random.uniform(low, high, size)
    near = random.choice([0.0, 1e-4, 0.01, 0.1], size) * random.uniform(size=size)
    straight = random.normal(-np.array([joint.offset for joint in machine.joints]), 0.05, size)
    straight[:, 0] = anywhere[:, 0]
    poses = [low + near, high - near, straight, anywhere, anywhere]
    return np.clip(np.choose(random.integers(0, 5, size), poses), low, high)


def pushed(own: list[float], random: np.random.Generator, ticks: int) -> FloatArray:
    axes = np.zeros((ticks, 6))
    for k in range(3):
        stick = int(own[law.table(own, 0, law.AXIS) + k])
        axes[:, stick] = random.choice([-1.0, -0.5, 0.0, 0.1, 0.5, 1.0], ticks)
    return axes


def solved(own: list[float], pose: FloatArray, velocity: FloatArray) -> FloatArray:
    law.solve_base(own, 0, pose.tolist(), *velocity.tolist())
    speeds = law.table(own, 0, law.SPEEDS)
    return np.array(own[speeds : speeds + len(pose)])


def tips(machine: Machine, poses: FloatArray, speeds: FloatArray) -> FloatArray:
    """Return the tip's velocities in m/s, shape ``(ticks, 3)``, as complex numbers turn."""
    lengths, offsets = np.transpose([(joint.a, joint.offset) for joint in machine.joints])
    turned = np.cumsum((poses + offsets)[:, 1:], axis=1)
    turning = np.cumsum(speeds[:, 1:], axis=1)
    links = lengths[1:] * np.exp(-1j * turned)
    radius, planar = lengths[0] + links.sum(axis=1).real, (-1j * turning * links).sum(axis=1)
    level = (planar.real + 1j * radius * speeds[:, 0]) * np.exp(1j * (poses[:, 0] + offsets[0]))
    return np.column_stack([level.real, level.imag, planar.imag])


def largest_leap(rig: str, command: Callable[..., None], ticks: int) -> float:
    """Return the largest change of the tip's velocity, in m/s, from one tick to the next."""
    random = np.random.default_rng()
    machine, block = rigged(rig)
    low, high = np.transpose(machine.limits)
    poses, axes = drawn(machine, random, ticks), pushed(block, random, ticks)
    own, velocities = np.array(block), []
    for _ in range(2):
        made = np.empty((ticks, 2 * len(low) + 1))
        for pose, pushes, out in zip(poses, axes, made, strict=True):
            command(own, 0, pushes, pose, out)
        speeds = made[:, : len(low)]
        velocities.append(tips(machine, poses, speeds))
        poses = np.clip(poses + speeds / RATE_HZ, low, high)
    return float(np.linalg.norm(velocities[1] - velocities[0], axis=1).max())


@pytest.mark.parametrize("rig", RIGS)
def test_no_tick_leaps_while_the_sticks_are_held(rig: str) -> None:
    assert largest_leap(rig, law.command, 500) < LEAP_M_S


EXCAVATOR_M = (0.2, 5.7, 2.9, 1.5)
"""Links of an excavator of 20 t."""
EXCAVATOR_DEG = ((-180.0, 180.0), (-60.0, 40.0), (30.0, 150.0), (-30.0, 140.0))


def swings(rig: str, rate_hz: float, seed: int, *, excavator: bool) -> int:
    """Return how often a joint's speed is reversed twice in two ticks while the sticks are held."""
    machine, _ = RIGS[rig]
    if excavator:
        about = zip(machine.joints, EXCAVATOR_M, EXCAVATOR_DEG, strict=True)
        links = [each.model_copy(update={"a": a, "range_deg": deg}) for each, a, deg in about]
        machine = machine.model_copy(update={"joints": tuple(links)})
        for name in machine.__dict__.keys() - type(machine).model_fields.keys():
            del machine.__dict__[name]
    speed = 2.7 if excavator else 1.0
    settings = end_effector(map=BASE, speed_m_s=speed)
    scheme = ready(EndEffector(settings, machine), machine)
    assert isinstance(scheme, EndEffector)
    own, random = scheme.law, np.random.default_rng(seed)
    low, high = np.transpose(machine.limits)
    pose, found = random.uniform(low, high), 0
    for _ in range(5):  # the sticks are held for 4 s each time
        axes, speeds = pushed(own, random, 1)[0].tolist(), []
        for _ in range(round(4.0 * rate_hz)):
            out = [0.0] * (2 * len(low) + 1)
            law.command(own, 0, axes, pose.tolist(), out)
            speeds.append(out[: len(low)])
            pose = np.clip(pose + np.array(out[: len(low)]) / rate_hz, low, high)
        steps = np.diff(speeds, axis=0)
        both = (steps[1:] * steps[:-1] < 0.0) & (np.minimum(abs(steps[1:]), abs(steps[:-1])) > 0.05)
        found += int(both.sum())
    return found


@pytest.mark.parametrize("rate_hz", [60.0, 240.0])
@pytest.mark.parametrize("excavator", [False, True])
@pytest.mark.parametrize("rig", [rig for rig in RIGS if rig.endswith("4")])
def test_no_joint_swings_to_and_fro_while_the_sticks_are_held(
    *, rig: str, rate_hz: float, excavator: bool
) -> None:
    """One that makes up for a joint at its limit did: 1.8 rad/s from tick to tick."""
    count = 8 if rate_hz < 100.0 else 2
    assert sum(swings(rig, rate_hz, seed, excavator=excavator) for seed in range(count)) <= 2


@pytest.mark.long
@needs("numba")
@pytest.mark.parametrize("rig", RIGS)
def test_none_of_a_million_ticks_leaps(rig: str) -> None:
    from labcrane.core import compiled

    assert largest_leap(rig, compiled.also(law.command), 1_000_000 // len(RIGS)) < LEAP_M_S


@pytest.mark.parametrize("rig", RIGS)
def test_no_held_stick_freezes_where_the_tip_can_go_there(rig: str) -> None:
    """The fastest straight movement within the joints' bounds is a linear programme's."""
    random = np.random.default_rng()
    machine, own = rigged(rig)
    low, high = np.transpose(machine.limits)
    full, joints = np.array(machine.speeds), len(low)
    asked = 0
    for pose in drawn(machine, random, 60):
        way = random.normal(size=3)
        way /= np.linalg.norm(way)
        moves = jacobian(machine, pose.tolist())
        along = way @ moves @ solved(own, pose, way)
        assert along > -1e-9, "the tip never goes against the stick"
        rows = np.column_stack([moves, -way])
        least = -full * np.clip((pose - low) / SOFT, 0.0, 1.0)
        most = full * np.clip((high - pose) / SOFT, 0.0, 1.0)
        best = linprog(
            [0.0] * joints + [-1.0], A_eq=rows, b_eq=np.zeros(len(rows)),
            bounds=[*zip(least, most, strict=True), (0.0, 1.0)],
        )  # fmt: skip
        if best.status == 0 and best.x[-1] > 0.02:
            asked += 1
            assert along > 0.4 * best.x[-1], (pose, way)
    assert asked or joints == 2, "two joints cannot go straight anywhere"


@pytest.mark.parametrize("machine", MACHINES.values(), ids=MACHINES)
def test_bounded_speeds_are_those_of_another_solver(machine: Machine) -> None:
    random = np.random.default_rng()
    own = law.block(machine, end_effector(), machine.speeds, "base")
    r, z, speeds, least, most = (
        law.table(own, 0, which)
        for which in (law.COLUMN_R, law.COLUMN_Z, law.SPEEDS, law.LEAST, law.MOST)
    )
    for pose in drawn(machine, random, 100):
        law.put_columns(own, 0, pose.tolist())
        down, up = -random.uniform(0.01, 0.5, 3), random.uniform(0.01, 0.5, 3)
        own[least + 1 : least + 4], own[most + 1 : most + 4] = down.tolist(), up.tolist()
        damping2, asked = 10.0 ** random.uniform(-3.0, -1.0), random.normal(size=2)
        law.bounded(own, 0, damping2, *asked.tolist())
        columns = np.array([own[r + 1 : r + 4], own[z + 1 : z + 4]])
        expected = lsq_linear(
            np.vstack([columns, math.sqrt(damping2) * np.eye(3)]), [*asked, 0.0, 0.0, 0.0],
            (down, up), method="bvls",
        )  # fmt: skip
        np.testing.assert_allclose(own[speeds + 1 : speeds + 4], expected.x, atol=1e-7)
