"""How fast each scheme moves the tip, and what a change of schemes does."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from scheme_setups import (
    ARM,
    BASE,
    JOINTS,
    LOW,
    MACHINES,
    end_effector,
    joint_velocity,
    push,
    ready,
    switchable,
)

from labcrane import Machine
from labcrane.core import Sphere
from labcrane.machines import jacobian, reach
from labcrane.testing import RATE_HZ, ch8, crane_at, make_run, make_trial
from labcrane_aiming.aiming import Aiming
from labcrane_aiming.settings import AimingSettings
from labcrane_schemes.end_effector import EndEffector
from labcrane_schemes.joint_velocity import JointVelocity
from labcrane_schemes.switchable import Switchable


def straight(machine: Machine, pose: Sequence[float]) -> list[float]:
    """Return how fast the tip can go along the arm, across it and up with the smallest speeds."""
    cos, sin = math.cos(pose[0]), math.sin(pose[0])
    across = np.linalg.pinv(jacobian(machine, pose))
    ways = [(cos, sin, 0.0), (-sin, cos, 0.0), (0.0, 0.0, 1.0)]
    return [1.0 / np.max(np.abs(across @ way) / machine.speeds) for way in ways]


def typical(machine: Machine, places: Sequence[Sphere]) -> float:
    poses = [reach(machine, place.centre) for place in places]
    return float(np.median([speed for pose in poses if pose for speed in straight(machine, pose)]))


@pytest.mark.parametrize("machine", MACHINES.values(), ids=MACHINES)
def test_schemes_are_alike_fast_at_the_targets_by_default(machine: Machine) -> None:
    places = Aiming(AimingSettings(), machine).places()
    scheme = Switchable(switchable(end_effector={"map": BASE}), machine)
    scheme.open(replace(make_run(machine, command=scheme.signals), places=tuple(places)))
    speed = scheme.metadata()["end_effector.speed_m_s"]
    assert speed == pytest.approx(typical(machine, places), rel=0.02)
    assert scheme.attainable(places) == pytest.approx(
        {"joint_velocity": speed, "end_effector": speed}, rel=0.05
    )
    state = crane_at(machine, LOW["ch8"].tolist())
    scheme.begin_trial(make_trial())
    scheme.command(push(), state)
    for _ in range(200):
        asked = scheme.command(push(left_x=-0.3, right_trigger=1), state)
    moved = jacobian(machine, LOW["ch8"].tolist()) @ asked[:4]
    share = (0.3 - 0.05) / 0.95
    np.testing.assert_allclose(moved, [0.0, share * speed, 0.0], atol=0.002)


def test_both_schemes_of_a_slower_study_are_as_much_slower() -> None:
    machine, half = ch8(), {"map": JOINTS, "speed": 0.5}
    places = Aiming(AimingSettings(), machine).places()
    scheme = Switchable(switchable(joint_velocity=half, end_effector={"map": BASE}), machine)
    full = typical(machine, places)
    assert scheme.attainable(places) == pytest.approx(
        {"joint_velocity": 0.5 * full, "end_effector": 0.5 * full}, rel=0.02
    )
    given = Switchable(switchable(), machine).attainable(places)
    assert given == pytest.approx({"joint_velocity": full, "end_effector": 0.5}, rel=0.02)


def test_without_targets_the_speed_is_of_poses_all_over() -> None:
    random = np.random.default_rng()
    machine = ch8()
    settings = end_effector(frame="arm", map=ARM, speed_m_s=None, soft_stop_deg=0.0)
    scheme = ready(EndEffector(settings, machine), machine)
    poses = random.uniform(*np.array(machine.limits).T, (500, 4))
    speeds = [straight(machine, pose.tolist()) for pose in poses]
    assert scheme.metadata()["speed_m_s"] == pytest.approx(np.median(speeds), rel=0.2)


def test_a_change_of_schemes_mixes_both_and_no_tick_jumps() -> None:
    random = np.random.default_rng()
    machine = ch8()
    state = crane_at(machine, LOW["ch8"].tolist())
    for start in ("joint_velocity", "end_effector"):
        hands = random.uniform(-1.0, 1.0, 6)
        hands[-1] = 0.0
        scheme = ready(Switchable(switchable(start=start, ramp_s=0.5), machine), machine)
        either = [
            ready(JointVelocity(joint_velocity(), machine), machine).command(hands, state)[:4],
            ready(EndEffector(end_effector(), machine), machine).command(hands, state)[:4],
        ]
        old, new = either if start == "joint_velocity" else either[::-1]
        made = [scheme.command(hands, state)[:4].copy()]
        for tick in range(round(0.6 * RATE_HZ)):
            hands[-1] = float(tick < 9)
            made.append(scheme.command(hands, state)[:4].copy())
        np.testing.assert_array_equal(made[0], old)
        np.testing.assert_array_equal(made[-1], new)
        shares = np.minimum(1.0, np.arange(len(made)) / (0.5 * RATE_HZ))[:, None]
        np.testing.assert_allclose(made, (1.0 - shares) * old + shares * new, atol=1e-9)


def test_sticks_let_go_of_in_a_change_stop_the_machine_at_once() -> None:
    machine = ch8()
    state = crane_at(machine, LOW["ch8"].tolist())
    scheme = ready(Switchable(switchable(), machine), machine)
    scheme.command(push(left_y=1), state)
    assert scheme.command(push(left_y=1, right_trigger=1), state)[:4].any()
    assert not scheme.command(push(right_trigger=1), state)[:4].any()
