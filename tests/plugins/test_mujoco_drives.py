"""Drives of limited torque against the conditions that define them, and against every way out."""

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
    asked = random.normal(size=joints) * random.choice([0.0, 1.0], joints)
    efforts = np.diag(mass)[:joints] * 10.0 ** random.uniform(-2, 3, joints)
    return mass, force, angles, speeds, asked, efforts, limits


def after(step, torques):
    mass, force, _, speeds, *_ = step
    whole = force.copy()
    whole[: len(torques)] += torques
    return speeds + DT * np.linalg.solve(mass, whole)


def ways_out(step):
    """Return the speeds with which each joint comes to its stops."""
    _, _, angles, *_, limits = step
    lowest, highest = np.array(limits).T
    angle = angles[: len(limits)]
    return np.minimum(lowest - angle, 0.0) / DT, np.maximum(highest - angle, 0.0) / DT


@settings(max_examples=400, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 7), st.integers(0, 2))
def test_a_drive_gives_all_it_has_only_where_its_joint_has_not_the_speed_asked_for(
    seed: int, joints: int, extra: int
) -> None:
    from labcrane_mujoco.limited_drives import limited_torques

    step = drawn(seed, joints, extra)
    drives, pushes = limited_torques(*step, DT)
    *_, asked, efforts, _ = step
    slowest, fastest = ways_out(step)
    speed = after(step, drives + pushes)[:joints]
    near = 1e-8 * (1.0 + np.abs(speed).max())
    wanted = np.clip(asked, slowest, fastest)
    assert (np.abs(drives) <= efforts).all()
    assert (drives[speed < wanted - near] == efforts[speed < wanted - near]).all()
    assert (drives[speed > wanted + near] == -efforts[speed > wanted + near]).all()
    assert (speed <= fastest + near).all(), "no joint goes through a stop"
    assert (speed >= slowest - near).all()
    assert (pushes[speed < fastest - near] >= 0.0).all(), "only an upper stop pushes down"
    assert (pushes[speed > slowest + near] <= 0.0).all(), "only a lower stop pushes up"
    assert (np.abs(drives[pushes != 0.0]) == efforts[pushes != 0.0]).all()


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 4))
def test_speeds_are_those_of_the_one_way_that_keeps_all_conditions(seed: int, joints: int) -> None:
    from labcrane_mujoco.limited_drives import limited_torques

    step = drawn(seed, joints, 1)
    mass, force, _, speeds, asked, efforts, _ = step
    slowest, fastest = ways_out(step)
    wanted = np.clip(asked, slowest, fastest)
    inverse = DT * np.linalg.inv(mass)
    free = (speeds + inverse @ force)[:joints]
    inverse = inverse[:joints, :joints]
    found = after(step, sum(limited_torques(*step, DT)))[:joints]
    near = 1e-7 * (1.0 + np.abs(found).max())
    solutions = []
    for ways in product(
        range(5), repeat=joints
    ):  # at a stop, all up, as asked, all down, at a stop
        way = np.array(ways)
        ends = np.choose(way, [slowest, wanted, wanted, wanted, fastest])
        torques = np.choose(way, [0.0 * efforts, efforts, 0.0 * efforts, -efforts, 0.0 * efforts])
        if (at := way % 2 == 0).any():
            gaps = (ends - free - inverse @ torques)[at]
            torques[at] = np.linalg.solve(inverse[np.ix_(at, at)], gaps)
        speed = free + inverse @ torques
        inside = (speed >= slowest - near) & (speed <= fastest + near)
        force_near = near / np.diag(inverse)
        up = torques <= efforts + force_near
        down = torques >= -efforts - force_near
        up |= (wanted <= slowest) | (way == 0)
        down |= (wanted >= fastest) | (way == 4)
        up &= (way != 4) | (torques <= force_near - efforts)
        down &= (way != 0) | (torques >= efforts - force_near)
        slow = (way != 1) | (speed <= wanted + near)
        fast = (way != 3) | (speed >= wanted - near)
        if (inside & up & down & slow & fast).all():
            solutions.append(speed)
    assert solutions, "the problem has a solution"
    assert max(np.abs(found - each).max() for each in solutions) < 100 * near
