"""Tip speeds that a scheme attains where a study has its targets."""

import math
import random
from collections.abc import Sequence
from statistics import median

from labcrane import Machine
from labcrane.core import Sphere
from labcrane.machines import Arm, reach
from labcrane_schemes.law import SPEEDS, solve, table

POSES = 64
"""Number of poses that represent a study without targets."""

DIRECTIONS = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
"""Along the arm, across it, and up."""

FAR_M_S = 1e3
"""A tip speed in m/s that no machine has."""


def attainable(
    machine: Machine, own: list[float], places: Sequence[Sphere], asked: float = FAR_M_S
) -> float:
    """Return the median tip speed in m/s, over places and directions, of a straight movement.

    Of a scheme that turns joints it is what a practised hand makes of them, who moves the tip by
    the same least squares.

    Parameters
    ----------
    own
        Block of the scheme's law.
    places
        The study's targets. Those out of reach are left out; without any that can be reached it is
        of poses drawn from the joints' ranges, always the same.
    asked
        Tip speed that is asked for, in m/s.
    """
    arm, foot, found = Arm(machine), machine.joints[0].a, []
    speeds = table(own, 0, SPEEDS)
    for pose in _poses(machine, places):
        columns = arm.planar_jacobian(pose)
        for direction in DIRECTIONS:
            solve(own, 0, list(pose), *(asked * part for part in direction))
            slew, *pitch = own[speeds : speeds + len(pose)]
            moved = (
                math.fsum(out * speed for (out, _), speed in zip(columns, pitch, strict=True)),
                slew * (foot - columns[0][1]),  # the first pitch axis may be before the slew axis
                math.fsum(up * speed for (_, up), speed in zip(columns, pitch, strict=True)),
            )
            found.append(math.fsum(map(math.prod, zip(direction, moved, strict=True))))
    return median(found)


def _poses(machine: Machine, places: Sequence[Sphere]) -> Sequence[Sequence[float]]:
    centres = dict.fromkeys(place.centre for place in places)
    found = [pose for centre in centres if (pose := reach(machine, centre)) is not None]
    spread = random.Random(0)  # noqa: S311 - the poses are not secret
    return found or [
        [spread.uniform(lowest, highest) for lowest, highest in machine.limits]
        for _ in range(POSES)
    ]
