"""Inverse kinematics: whether a point can be reached, and with which joint angles."""

import math
import random
from collections.abc import Sequence

from labcrane.machines.kinematics import Arm
from labcrane.machines.machine import Machine

Triple = tuple[float, float, float]

TOLERANCE_M = 1e-4
STARTS = 24
STEPS = 60
DAMPING = 0.05  # metres per radian; small beside the metre-long links


def reach(machine: Machine, point: Sequence[float]) -> tuple[float, ...] | None:
    """Return joint angles in rad that put the tip at ``point`` in m, or None where none do.

    Damped Gauss-Newton steps from poses spread over the joint ranges, always with the arm turned
    towards the point; joints stay within their limits, which is part of the question here. In
    scalars, as ``Arm`` is: a few points are asked for, and loading numpy would take longer.
    """
    arm = Arm(machine)
    bearing = math.atan2(point[1], point[0] - machine.base_x) - machine.joints[0].offset
    spread = random.Random(0)  # noqa: S311 - start values need no cryptography
    for start in range(STARTS):
        chain = (
            machine.rest[1:]
            if start == 0
            else [spread.uniform(*each) for each in machine.limits[1:]]
        )
        angles = _within(machine, [bearing, *chain])
        for _ in range(STEPS):
            tip = arm.tip(angles)
            miss = (point[0] - tip[0], point[1] - tip[1], point[2] - tip[2])
            if math.hypot(*miss) < TOLERANCE_M:
                return tuple(angles)
            steps = _steps(_slope(arm, angles), miss)
            angles = _within(
                machine, [each + step for each, step in zip(angles, steps, strict=True)]
            )
    return None


def _within(machine: Machine, angles: Sequence[float]) -> list[float]:
    limits = zip(angles, machine.limits, strict=True)
    return [min(max(angle, lowest), highest) for angle, (lowest, highest) in limits]


def _slope(arm: Arm, angles: Sequence[float]) -> list[Triple]:
    """Return the tip's velocity in m/rad per joint speed, joint by joint: the Jacobian."""
    bearing, radius = arm.bearing(angles), arm.plane(angles)[0]
    ahead, aside = math.cos(bearing), math.sin(bearing)
    slew = (-radius * aside, radius * ahead, 0.0)
    return [slew, *((out * ahead, out * aside, up) for out, up in arm.planar_jacobian(angles))]


def _steps(slope: Sequence[Triple], miss: Triple) -> list[float]:
    """Return the steps in rad that make up for a miss in m: ``J' (J J' + d^2 I)^-1 miss``."""
    rows = [
        [sum(a[i] * a[j] for a in slope) + (DAMPING**2 if i == j else 0.0) for j in range(3)]
        for i in range(3)
    ]
    # Solved by cross products: the matrix is symmetric, and damping keeps it from being singular.
    across = [_cross(rows[1], rows[2]), _cross(rows[2], rows[0]), _cross(rows[0], rows[1])]
    volume = _dot(rows[0], across[0])
    solved = [sum(miss[i] * across[i][k] for i in range(3)) / volume for k in range(3)]
    return [_dot(each, solved) for each in slope]


def _cross(a: Sequence[float], b: Sequence[float]) -> Triple:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _dot(a: Sequence[float], b: Sequence[float]) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
