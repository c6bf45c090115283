"""Whether a point can be reached, and with which joint angles."""

import math
from collections.abc import Sequence

import numpy as np

from labcrane.kinematics import Arm, jacobian
from labcrane.machine import Machine

TOLERANCE_M = 1e-4
STARTS = 24
STEPS = 60
DAMPING = 0.05  # metres per radian; small beside the metre-long links


def reach(machine: Machine, point: Sequence[float]) -> tuple[float, ...] | None:
    """Return joint angles in rad that put the tip at ``point`` in m, or None where none do.

    Damped Gauss-Newton steps from poses spread over the joint ranges, always with the arm turned
    towards the point; joints stay within their limits, which is part of the question here.
    """
    arm = Arm(machine)
    lowest, highest = np.array(machine.limits).T
    bearing = math.atan2(point[1], point[0] - machine.base_x) - machine.joints[0].offset
    starts = np.random.default_rng(0).uniform(lowest, highest, (STARTS, len(lowest)))
    starts[:, 0] = bearing
    starts[0, 1:] = machine.rest[1:]
    for start in np.clip(starts, lowest, highest):
        angles = start
        for _ in range(STEPS):
            miss = np.asarray(point) - arm.tip(angles.tolist())
            if np.linalg.norm(miss) < TOLERANCE_M:
                return tuple(angles.tolist())
            slope = jacobian(machine, angles.tolist())
            damped = slope @ slope.T + DAMPING**2 * np.eye(3)
            angles = np.clip(angles + slope.T @ np.linalg.solve(damped, miss), lowest, highest)
    return None
