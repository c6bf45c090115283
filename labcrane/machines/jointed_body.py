"""Jointed body: the segments of a lying person, their masses, and the hinges between them.

Of a thing that is one rigid body there is one segment. Positions and turns of segments are those of
their first part, in the placed thing as in the state's signals.
"""

import math
from dataclasses import dataclass, replace

from labcrane.machines.human_figure import LIMBS, Geom, Point
from labcrane.machines.scene import PlacedObject

MASS_SHARES = {
    "head": 0.0694,
    "torso": 0.3229,  # upper and middle trunk
    "pelvis": 0.1117,  # lower trunk
    "upper_arm": 0.0271,
    "forearm": 0.0223,  # with the hand
    "thigh": 0.1416,
    "shank": 0.0570,  # with the foot
}
"""Mass of a segment as a share of the whole: de Leva, "Adjustments to Zatsiorsky-Seluyanov's
segment inertia parameters", J Biomech 29(9):1223-1230 (1996), men."""

UP, DOWN, LEFT = (0.0, -1.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
"""Axes about which a segment whose x axis goes along it turns up, down, and to the left."""

ALONG = (1.0, 0.0, 0.0)

RANGES: dict[str, tuple[tuple[Point, float, float, float], ...]] = {
    "head": ((DOWN, -45.0, 45.0, 2.0), (LEFT, -40.0, 40.0, 2.0)),
    "pelvis": ((UP, -20.0, 60.0, 8.0), (LEFT, -25.0, 25.0, 8.0), (ALONG, -30.0, 30.0, 8.0)),
    "upper_arm": ((LEFT, -20.0, 170.0, 3.0), (UP, -40.0, 170.0, 3.0), (ALONG, -80.0, 80.0, 1.5)),
    "forearm": ((UP, -3.0, 145.0, 1.5),),
    "thigh": ((LEFT, -25.0, 50.0, 5.0), (UP, -20.0, 120.0, 5.0), (ALONG, -45.0, 45.0, 3.0)),
    "shank": ((DOWN, -3.0, 140.0, 3.0),),
}
"""Axis, lowest and highest angle in degrees, and friction in N m of each hinge, in their order from
the body outward; "left" is outward for a right limb too. Angles count from straight along the body.
The angles are rounded from typical values of adults. The friction is an assumption: that of a
person who does not hold the limb."""


@dataclass(frozen=True, slots=True)
class Hinge:
    """One axis of a joint.

    Attributes
    ----------
    axis
        In the segment's own frame.
    lowest, highest
        From where the segment was placed, in rad.
    friction
        Torque that it takes to move it, in N m.
    """

    axis: Point
    lowest: float
    highest: float
    friction: float


@dataclass(frozen=True, slots=True)
class Segment:
    """A rigid part of a thing.

    Attributes
    ----------
    name
        Of the thing alone for its first segment, with the part's name behind it for the others;
        ``scene.NAME.position`` and ``.orientation`` say where it is.
    parent
        Name of the segment that it hangs on; None for the first one.
    parts
        In the thing's frame, as placed.
    mass
        In kg.
    joint
        Where the hinges are, in the thing's frame as placed, in m.
    hinges
        From the parent outward.
    """

    name: str
    parent: str | None
    parts: tuple[Geom, ...]
    mass: float
    joint: Point = (0.0, 0.0, 0.0)
    hinges: tuple[Hinge, ...] = ()


def segments(placed: PlacedObject) -> tuple[Segment, ...]:
    """Return the bodies of a thing, each after the one that it hangs on."""
    if not placed.jointed:
        return (Segment(placed.name, None, placed.parts, placed.mass),)
    parts: dict[str, tuple[Geom, ...]] = {}
    for part in placed.parts:
        parts[part.name] = (*parts.get(part.name, ()), part)
    first, *others = parts
    found = [Segment(placed.name, None, parts[first], placed.mass * _share(first))]
    for name in others:
        parent = LIMBS[name][0] if name in LIMBS else None
        parent = parent or ("pelvis" if name.endswith("thigh") else first)
        joint = _near_end(parts[name][0])
        heading = parts[name][0].yaw - parts[parent][-1].yaw
        found.append(
            Segment(
                f"{placed.name}.{name}",
                placed.name if parent == first else f"{placed.name}.{parent}",
                parts[name],
                placed.mass * _share(name),
                joint,
                _hinges(name, heading),
            )
        )
    return tuple(found)


def beside(first: Geom, part: Geom) -> Geom:
    """Return a part in the frame of another one."""
    away = [at - origin for at, origin in zip(part.centre, first.centre, strict=True)]
    cos, sin = math.cos(first.yaw), math.sin(first.yaw)
    x, y, z = away
    return replace(
        part, centre=(cos * x + sin * y, -sin * x + cos * y, z), yaw=part.yaw - first.yaw
    )


def _kind(name: str) -> str:
    return name.removeprefix("left_").removeprefix("right_")


def _share(name: str) -> float:
    return MASS_SHARES[_kind(name)]


def _near_end(part: Geom) -> Point:
    x, y, z = part.centre
    if part.name == "head":
        return x + 0.5 * part.size[0] + 0.02, y, z  # the neck, towards the chest
    half = 0.5 * part.size[0]
    return x - half * math.cos(part.yaw), y - half * math.sin(part.yaw), z


def _hinges(name: str, heading: float) -> tuple[Hinge, ...]:
    found = []
    outward = -1.0 if name.startswith("right") else 1.0
    for axis, lowest, highest, friction in RANGES[_kind(name)]:
        aside = axis == LEFT and name in LIMBS
        # As placed it is turned aside already, and no other way.
        already = outward * heading if aside else 0.0
        found.append(
            Hinge(
                (axis[0], axis[1], outward * axis[2]) if aside else axis,
                math.radians(lowest) - already,
                math.radians(highest) - already,
                friction,
            )
        )
    return tuple(found)


def stands(placed: PlacedObject, part: Geom) -> tuple[Point, float]:
    """Return where a part was placed: its centre in m, and its turn about the vertical in rad."""
    cos, sin = math.cos(placed.yaw), math.sin(placed.yaw)
    (x, y, z), (ahead, left, up) = part.centre, placed.position
    return (ahead + cos * x - sin * y, left + sin * x + cos * y, up + z), placed.yaw + part.yaw
