"""End stops against the conditions that they are defined by, and against every way to hold."""

from itertools import product

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from needs import needs

DT = 1 / 240.0

pytestmark = needs("mujoco")


def drawn(seed: int, joints: int, extra: int):
    """Return a step whose joints are near their limits, or at them, or a little beyond."""
    random = np.random.default_rng(seed)
    size = joints + extra
    root = random.normal(size=(size, size))
    mass = (root @ root.T + 0.05 * np.eye(size)) * 10.0 ** random.uniform(0, 4)
    limits = [(-1.0, 1.0)] * joints
    angles = random.choice([-1.0, 1.0], size) * (1.0 - 10.0 ** random.uniform(-9, -1, size))
    angles += random.choice([0.0, 0.0, 1e-13], size)
    speeds = random.normal(size=size)
    force = mass @ random.normal(size=size) * random.choice([0.0, 1.0, 300.0])
    return mass, force, angles, speeds, limits


def after(step, push):
    mass, force, _, speeds, limits = step
    whole = force.copy()
    whole[: len(limits)] += push
    return speeds + DT * np.linalg.solve(mass, whole)


def ways_out(step):
    """Return by how much each joint's speed is above the least, below the most that is allowed."""
    _, _, angles, _, limits = step
    lowest, highest = np.array(limits).T
    angle = angles[: len(limits)]
    return np.minimum(lowest - angle, 0.0) / DT, np.maximum(highest - angle, 0.0) / DT


@settings(max_examples=300, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 6), st.integers(0, 2))
def test_no_joint_goes_through_and_no_stop_pulls(seed: int, joints: int, extra: int) -> None:
    from labcrane_mujoco.end_stops import stop_forces

    step = drawn(seed, joints, extra)
    push = stop_forces(*step, DT)
    slowest, fastest = ways_out(step)
    speed = after(step, push)[:joints]
    near = 1e-8 * (1.0 + np.abs(speed).max())
    assert (speed <= fastest + near).all()
    assert (speed >= slowest - near).all()
    assert (push[speed < fastest - near] >= 0.0).all(), "only an upper stop pushes down"
    assert (push[speed > slowest + near] <= 0.0).all(), "only a lower stop pushes up"


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 4))
def test_the_stops_hold_the_joints_that_one_of_all_ways_to_hold_them_allows(
    seed: int, joints: int
) -> None:
    from labcrane_mujoco.end_stops import stop_forces

    step = drawn(seed, joints, 1)
    mass, force, _, speeds, _ = step
    slowest, fastest = ways_out(step)
    inverse = DT * np.linalg.inv(mass)
    free = (speeds + inverse @ force)[:joints]
    inverse = inverse[:joints, :joints]
    solutions = []
    for ways in product([-1, 0, 1], repeat=joints):
        at = [joint for joint, way in enumerate(ways) if way]
        ends = np.where(np.array(ways) < 0, slowest, fastest)
        push = np.zeros(joints)
        if at:
            push[at] = np.linalg.solve(inverse[np.ix_(at, at)], (ends - free)[at])
        speed = free + inverse @ push
        if (push * ways <= 0.0).all() and (
            np.maximum(speed - fastest, slowest - speed) < 1e-9
        ).all():
            solutions.append(speed)
    assert solutions, "the problem has a solution"
    found = after(step, stop_forces(*step, DT))[:joints]
    assert min(np.abs(found - each).max() for each in solutions) < 1e-6 * (1 + np.abs(found).max())
