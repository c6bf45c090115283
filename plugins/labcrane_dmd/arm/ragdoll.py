"""Ragdoll: a jointed figure as URDF text, its hinges one after the other.

A joint of several hinges has links of next to no mass between them. Every link's frame is at its
joint, turned as its segment was placed, so that all angles are 0 at the start.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from labcrane.machines import Geom, Hinge, PlacedObject, Segment, ShapeKind, beside, segments

BETWEEN_KG = 0.02
"""Mass of a link between two hinges; the segment behind them has that much less."""

BETWEEN_M = 0.05
"""Size from which the link between two hinges has its inertia: with less, the hinges' accelerations
are indistinguishable."""

FAST = 20.0
"""Speed in rad/s that URDF asks for; the engine does not keep to it."""


@dataclass(frozen=True, slots=True)
class Ragdoll:
    """A figure for the engine.

    Attributes
    ----------
    urdf
        Its text; the base is the first segment.
    parts
        Name of the part of every link that has a shape, the base's included.
    segments
        Name of the segment of the same links.
    centres
        Where the first part's centre is in the segment's link, in m.
    hinges
        By the name of the joint, which is that of the link behind it.
    """

    urdf: str
    parts: dict[str, str]
    segments: dict[str, str]
    centres: dict[str, tuple[float, float, float]]
    hinges: dict[str, Hinge]


def ragdoll(placed: PlacedObject) -> Ragdoll:
    """Return a jointed figure as it lies."""
    lines = ['<robot name="figure">']
    found = Ragdoll("", {}, {}, {}, {})
    frames: dict[str, Geom] = {}
    for segment in segments(placed):
        first = segment.parts[0]
        name = first.name
        frame = Geom(name, first.shape, first.size, segment.joint, first.yaw)
        frames[segment.name] = frame if segment.parent else first
        if segment.parent:
            place = beside(frames[segment.parent], frame)
            lines += _chain(segment, place, parent=frames[segment.parent].name, found=found)
        lines.append(_link(name, segment, frames[segment.name]))
        found.parts[name], found.segments[name] = name, segment.name
        found.centres[name] = beside(frames[segment.name], first).centre
    text = "\n".join([*lines, "</robot>"]) + "\n"
    return Ragdoll(text, found.parts, found.segments, found.centres, found.hinges)


def _chain(segment: Segment, place: Geom, *, parent: str, found: Ragdoll) -> list[str]:
    """Return the hinges between two segments, and the links between them."""
    name, lines = segment.parts[0].name, []
    for number, hinge in enumerate(segment.hinges, start=1):
        last = number == len(segment.hinges)
        child = name if last else f"{name}_{number}"
        at, yaw = (place.centre, place.yaw) if number == 1 else ((0.0, 0.0, 0.0), 0.0)
        axis = " ".join(map(repr, hinge.axis))
        lines.append(
            f'<joint name="{child}" type="revolute"><parent link="{parent}"/>'
            f'<child link="{child}"/>{_origin(at, (0.0, 0.0, yaw))}<axis xyz="{axis}"/>'
            f'<limit lower="{hinge.lowest!r}" upper="{hinge.highest!r}" '
            f'effort="{hinge.friction!r}" velocity="{FAST!r}"/></joint>'
        )
        found.hinges[child] = hinge
        if not last:
            lines.append(f'<link name="{child}">{_inertial(BETWEEN_KG, (BETWEEN_M,) * 3)}</link>')
        parent = child
    return lines


def _link(name: str, segment: Segment, frame: Geom) -> str:
    parts = [beside(frame, part) for part in segment.parts]
    mass = segment.mass - BETWEEN_KG * max(0, len(segment.hinges) - 1)
    # Of a bent limb, that of a straight one: a few percent, and no axis that is out of line.
    long = sum(part.size[0] for part in parts)
    x, y, z = (sum(each) / len(parts) for each in zip(*(p.centre for p in parts), strict=True))
    size = (long, *parts[0].size[1:])
    return (
        f'<link name="{name}">{_inertial(mass, size, (x, y, z))}'
        + "".join(map(_collision, parts))
        + "</link>"
    )


def _inertial(
    mass: float, size: Sequence[float], centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> str:
    x, y, z = (edge * edge for edge in size)
    ixx, iyy, izz = (mass / 12.0 * both for both in (y + z, x + z, x + y))
    return (
        f'<inertial>{_origin(centre)}<mass value="{mass!r}"/>'
        f'<inertia ixx="{ixx!r}" iyy="{iyy!r}" izz="{izz!r}" ixy="0" ixz="0" iyz="0"/></inertial>'
    )


def _collision(part: Geom) -> str:
    x, y, _ = part.size
    turn = (0.0, 0.0, part.yaw)
    if part.shape is ShapeKind.SPHERE:
        shape = f'<sphere radius="{x / 2!r}"/>'
    elif part.shape is ShapeKind.CAPSULE:
        shape = f'<capsule radius="{y / 2!r}" length="{max(x - y, 0.01)!r}"/>'
        turn = (0.0, math.pi / 2.0, part.yaw)  # the engine's stand along z
    else:
        shape = f'<box size="{" ".join(map(repr, part.size))}"/>'
    return f"<collision>{_origin(part.centre, turn)}<geometry>{shape}</geometry></collision>"


def _origin(
    place: tuple[float, float, float], turn: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> str:
    xyz, rpy = (" ".join(repr(number) for number in vector) for vector in (place, turn))
    return f'<origin xyz="{xyz}" rpy="{rpy}"/>'
