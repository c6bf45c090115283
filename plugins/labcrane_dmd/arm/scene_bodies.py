"""A scene's things in the engine."""

import math
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from labcrane import ProtocolError
from labcrane.machines import Geom, PlacedObject, ShapeKind, beside, points_in_numbers, stands
from labcrane_dmd.arm.engine import pybullet
from labcrane_dmd.arm.ragdoll import ragdoll

OVERLAP_M = 0.002
"""Depth, in metres, by which two things may overlap at the start."""

ROLLING = 0.002
"""Rolling friction in metres: without it a ball never comes to rest."""

LYING = [0.0, math.pi / 2.0, 0.0]
"""The engine's capsules stand along z; ours lie along x."""

STOP_NM = 1e4
"""Torque that the stop of a hinge can give, in N m; the engine's own is weak (bullet3 #2944)."""

LINK_NAME = 12
"""Index of the link's name in the engine's description of a joint."""

DISTANCE = 8
"""Place of the distance in the engine's closest points; below 0 inside each other."""


@dataclass(frozen=True, slots=True)
class StandingBody:
    """A thing in the engine: its number, parts and segments.

    Attributes
    ----------
    parts
        Name of the part by link; -1 is the base.
    segments
        For every segment but the first: its link, and its first part's centre in that link, in m.
    """

    placed: PlacedObject
    body: int
    parts: Mapping[int, str]
    segments: Mapping[str, tuple[int, tuple[float, float, float]]] = field(default_factory=dict)


def add_ground(client: int) -> int:
    """Put the ground, at height 0, into the engine."""
    plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=client)
    ground: int = pybullet.createMultiBody(0.0, plane, physicsClientId=client)
    pybullet.changeDynamics(ground, -1, lateralFriction=1.0, physicsClientId=client)
    return ground


def add(placed: PlacedObject, client: int) -> StandingBody:
    """Put a thing into the engine: articulated with joints, all others as one rigid body."""
    return _add_jointed(placed, client) if placed.jointed else _add_rigid(placed, client)


def _add_rigid(placed: PlacedObject, client: int) -> StandingBody:
    """Put a thing into the engine: its first part is the body, the others are fixed to it."""
    shapes = [_shape(part, client) for part in placed.parts]
    mass = 0.0 if placed.kind == "obstacle" else placed.mass
    shares = _shares(placed)
    first, *_ = placed.parts
    turn = pybullet.getQuaternionFromEuler
    # The first part's centre is the body's; the others' places count from there.
    others = [beside(first, part) for part in placed.parts[1:]]
    at, yaw = stands(placed, first)
    count = len(others)
    body = pybullet.createMultiBody(
        baseMass=mass * shares[0],
        baseCollisionShapeIndex=shapes[0],
        basePosition=at,
        baseOrientation=turn([0.0, 0.0, yaw]),
        linkMasses=[mass * share for share in shares[1:]],
        linkCollisionShapeIndices=shapes[1:],
        linkVisualShapeIndices=[-1] * count,
        linkPositions=[part.centre for part in others],
        linkOrientations=[turn([0.0, 0.0, part.yaw]) for part in others],
        linkInertialFramePositions=[[0.0, 0.0, 0.0]] * count,
        linkInertialFrameOrientations=[[0.0, 0.0, 0.0, 1.0]] * count,
        linkParentIndices=[0] * count,
        linkJointTypes=[pybullet.JOINT_FIXED] * count,
        linkJointAxis=[[0.0, 0.0, 1.0]] * count,
        physicsClientId=client,
    )
    _surface(placed, body, count, client)
    names = {number - 1: part.name for number, part in enumerate(placed.parts)}
    return StandingBody(placed, body, names)


def _add_jointed(placed: PlacedObject, client: int) -> StandingBody:
    """Put a jointed figure into the engine, with friction in its hinges and stops at their ends."""
    doll = ragdoll(placed)
    at, yaw = stands(placed, placed.parts[0])
    with tempfile.TemporaryDirectory(prefix="labcrane-") as folder, points_in_numbers():
        path = Path(folder) / "figure.urdf"
        path.write_text(doll.urdf, encoding="utf-8")
        body = pybullet.loadURDF(
            str(path),
            basePosition=at,
            baseOrientation=pybullet.getQuaternionFromEuler([0.0, 0.0, yaw]),
            flags=pybullet.URDF_USE_INERTIA_FROM_FILE,
            physicsClientId=client,
        )
    links = {}
    for joint in range(pybullet.getNumJoints(body, physicsClientId=client)):
        about = pybullet.getJointInfo(body, joint, physicsClientId=client)
        links[about[LINK_NAME].decode()] = joint
    _surface(placed, body, len(links), client)
    for name, hinge in doll.hinges.items():
        pybullet.changeDynamics(body, links[name], jointLimitForce=STOP_NM, physicsClientId=client)
        # A motor with target speed 0 and little torque acts as dry friction.
        pybullet.setJointMotorControl2(
            body,
            links[name],
            pybullet.VELOCITY_CONTROL,
            targetVelocity=0.0,
            force=hinge.friction,
            physicsClientId=client,
        )
    return StandingBody(
        placed,
        body,
        {links.get(name, -1): part for name, part in doll.parts.items()},
        {
            segment: (links[name], doll.centres[name])
            for name, segment in doll.segments.items()
            if name in links
        },
    )


def _surface(placed: PlacedObject, body: int, count: int, client: int) -> None:
    for link in range(-1, count):
        pybullet.changeDynamics(
            body,
            link,
            lateralFriction=placed.friction,
            rollingFriction=ROLLING,
            linearDamping=0.0,
            angularDamping=0.0,
            physicsClientId=client,
        )
        if placed.jointed:  # apart from the rest, as settings in one call can displace each other
            pybullet.changeDynamics(body, link, jointDamping=0.0, physicsClientId=client)


def _shares(placed: PlacedObject) -> list[float]:
    """Return each part's share of the mass: by the boxes around them, of a figure the same for all.

    A figure of one piece is as it always was: what was recorded with it must move so again.
    """
    if placed.kind == "body":
        return [1.0 / len(placed.parts)] * len(placed.parts)
    sizes = [math.prod(part.size) for part in placed.parts]
    return [size / sum(sizes) for size in sizes]


def check_apart(standing: list[StandingBody], arm: int, client: int) -> None:
    """Reject a scene in which things overlap each other or the arm.

    Fixed things may overlap fixed things, as in rubble.
    """
    bodies = [("the arm", arm), *((each.placed.name, each.body) for each in standing)]
    fixed = {each.body for each in standing if each.placed.kind == "obstacle"}
    for number, (one, first) in enumerate(bodies):
        for other, second in bodies[number + 1 :]:
            if {first, second} <= fixed:
                continue
            near: tuple[Any, ...] = pybullet.getClosestPoints(
                first, second, 0.0, physicsClientId=client
            )
            deep = -min((point[DISTANCE] for point in near), default=0.0)
            if deep > OVERLAP_M:
                raise ProtocolError(
                    f"{other!r} overlaps {one!r} by {deep:.3f} m at the start of the trial; "
                    "move it, or scatter it less"
                )


def _shape(part: Geom, client: int) -> int:
    x, y, z = part.size
    shape = part.shape
    if shape is ShapeKind.BOX:
        made = pybullet.createCollisionShape(
            pybullet.GEOM_BOX, halfExtents=[x / 2, y / 2, z / 2], physicsClientId=client
        )
    elif shape is ShapeKind.SPHERE:
        made = pybullet.createCollisionShape(
            pybullet.GEOM_SPHERE, radius=x / 2, physicsClientId=client
        )
    elif shape is ShapeKind.HULL:
        made = pybullet.createCollisionShape(
            pybullet.GEOM_MESH, vertices=part.points, physicsClientId=client
        )
    elif shape is ShapeKind.CYLINDER:
        made = pybullet.createCollisionShape(
            pybullet.GEOM_CYLINDER, radius=x / 2, height=z, physicsClientId=client
        )
    else:
        made = pybullet.createCollisionShape(
            pybullet.GEOM_CAPSULE,
            radius=y / 2,
            height=max(x - y, 0.01),
            collisionFrameOrientation=pybullet.getQuaternionFromEuler(LYING),
            physicsClientId=client,
        )
    return int(made)
