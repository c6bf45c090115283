"""A scene's things in the engine."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from labcrane import ProtocolError
from labcrane.machines import PlacedObject, ShapeKind
from labcrane_dmd.arm.engine import pybullet

OVERLAP_M = 0.002
"""Depth, in metres, to which two things may stand in each other at the start."""

ROLLING = 0.002
"""Rolling friction in metres: without it a ball never comes to rest."""

LYING = [0.0, math.pi / 2.0, 0.0]
"""The engine's capsules stand along z; ours lie along x."""

DISTANCE = 8
"""Place of the distance in the engine's closest points; below 0 inside each other."""


@dataclass(frozen=True, slots=True)
class Standing:
    """A thing in the engine: its number there, and the name of the part behind each link."""

    placed: PlacedObject
    body: int
    parts: Mapping[int, str]


def add_ground(client: int) -> int:
    """Put the ground, at height 0, into the engine."""
    plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=client)
    ground: int = pybullet.createMultiBody(0.0, plane, physicsClientId=client)
    pybullet.changeDynamics(ground, -1, lateralFriction=1.0, physicsClientId=client)
    return ground


def add(placed: PlacedObject, client: int) -> Standing:
    """Put a thing into the engine: its first part is the body, the others are fixed to it."""
    shapes = [_shape(part.shape, part.size, client) for part in placed.parts]
    mass = 0.0 if placed.kind == "obstacle" else placed.mass
    each = mass / len(placed.parts)
    first, *others = placed.parts
    turn = pybullet.getQuaternionFromEuler
    # The first part's centre is the body's; the others' places count from there.
    at = _turned(first.centre, placed.yaw, placed.position)
    count = len(others)
    body = pybullet.createMultiBody(
        baseMass=each,
        baseCollisionShapeIndex=shapes[0],
        basePosition=at,
        baseOrientation=turn([0.0, 0.0, placed.yaw + first.yaw]),
        linkMasses=[each] * count,
        linkCollisionShapeIndices=shapes[1:],
        linkVisualShapeIndices=[-1] * count,
        linkPositions=[
            [part.centre[axis] - first.centre[axis] for axis in range(3)] for part in others
        ],
        linkOrientations=[turn([0.0, 0.0, part.yaw]) for part in others],
        linkInertialFramePositions=[[0.0, 0.0, 0.0]] * count,
        linkInertialFrameOrientations=[[0.0, 0.0, 0.0, 1.0]] * count,
        linkParentIndices=[0] * count,
        linkJointTypes=[pybullet.JOINT_FIXED] * count,
        linkJointAxis=[[0.0, 0.0, 1.0]] * count,
        physicsClientId=client,
    )
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
    names = {number - 1: part.name for number, part in enumerate(placed.parts)}
    return Standing(placed, body, names)


def check_apart(standing: list[Standing], arm: int, client: int) -> None:
    """Refuse a scene in which things stand in each other or in the arm."""
    bodies = [("the arm", arm), *((each.placed.name, each.body) for each in standing)]
    for number, (one, first) in enumerate(bodies):
        for other, second in bodies[number + 1 :]:
            near: tuple[Any, ...] = pybullet.getClosestPoints(
                first, second, 0.0, physicsClientId=client
            )
            deep = -min((point[DISTANCE] for point in near), default=0.0)
            if deep > OVERLAP_M:
                raise ProtocolError(
                    f"{other!r} stands {deep:.3f} m deep in {one!r} at the start of the trial; "
                    "move it, or scatter it less"
                )


def _shape(shape: ShapeKind, size: tuple[float, float, float], client: int) -> int:
    x, y, z = size
    if shape is ShapeKind.BOX:
        made = pybullet.createCollisionShape(
            pybullet.GEOM_BOX, halfExtents=[x / 2, y / 2, z / 2], physicsClientId=client
        )
    elif shape is ShapeKind.SPHERE:
        made = pybullet.createCollisionShape(
            pybullet.GEOM_SPHERE, radius=x / 2, physicsClientId=client
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


def _turned(
    point: tuple[float, float, float], yaw: float, origin: tuple[float, float, float]
) -> list[float]:
    at, _ = pybullet.multiplyTransforms(
        origin, pybullet.getQuaternionFromEuler([0.0, 0.0, yaw]), point, [0.0, 0.0, 0.0, 1.0]
    )
    return list(at)
