"""Pairs of circles, and where they are."""

import math
from dataclasses import dataclass

from labcrane_aiming.settings import AimingSettings

Point = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Pair:
    """Two circles, on a diagonal through the centre.

    Attributes
    ----------
    name
        The level of the design factor ``pairs``: ``"2m_far_left"``.
    distance
        Between the centres, in metres.
    side
        On which side, seen from the machine, the far circle is.
    near, far
        Centres in the base frame, in metres.
    """

    name: str
    distance: float
    side: str
    near: Point
    far: Point


def pairs(settings: AimingSettings) -> tuple[Pair, ...]:
    """Return every distance in both mirror images, as written."""
    found = []
    angle = math.radians(settings.diagonal_deg)
    x, y, z = settings.centre
    for distance in settings.distances:
        forward, aside = distance / 2 * math.cos(angle), distance / 2 * math.sin(angle)
        for side, sign in (("left", 1.0), ("right", -1.0)):
            near = (x - forward, y - sign * aside, z)
            far = (x + forward, y + sign * aside, z)
            found.append(Pair(f"{distance:g}m_far_{side}", distance, side, near, far))
    return tuple(found)


def index_of_difficulty(distance: float, width: float) -> float:
    """Return ``log2(D / W + 1)`` in bits (Soukoreff & MacKenzie 2004)."""
    return math.log2(distance / width + 1.0)
