"""Meshes of what stands around the machine: objects, obstacles, a human figure."""

import math
from collections.abc import Iterator, Sequence

import numpy as np
from scipy.spatial import ConvexHull

from labcrane import FloatArray
from labcrane.machines import Geom, PlacedObject, ShapeKind, beside
from labcrane_view.scene.mesh import Mesh, bevelled_box, cone, flat, joined, sphere
from labcrane_view.scene.mesh_reader import painted, read_mesh

Colour = tuple[float, float, float, float]

OBJECT: Colour = (0.16, 0.36, 0.68, 1.0)
OBSTACLE: Colour = (0.55, 0.53, 0.50, 1.0)
SKIN: Colour = (0.80, 0.58, 0.45, 1.0)
JACKET: Colour = (0.75, 0.22, 0.14, 1.0)
TROUSERS: Colour = (0.20, 0.23, 0.32, 1.0)
CLOTHES = {"head": SKIN, "torso": JACKET, "pelvis": TROUSERS}


def pieces(thing: PlacedObject, parts: Sequence[Geom]) -> Iterator[tuple[Mesh, Colour]]:
    """Yield a mesh for each of a segment's parts, in the frame in which it moves, with its colour.

    That is the frame of its first part, whose centre is what ``scene.NAME.position`` says.
    """
    for part in parts:
        if not part.drawn:
            continue
        placed = beside(parts[0], part)
        colour = _colour(thing, part)
        if part.mesh is not None:
            colour = painted(part.mesh, colour)
        yield _turned(_solid(part), placed.yaw).moved(placed.centre), colour


def _colour(thing: PlacedObject, part: Geom) -> Colour:
    if thing.kind == "obstacle":
        return OBSTACLE
    if thing.kind == "object":
        return OBJECT
    if part.name in CLOTHES:
        return CLOTHES[part.name]
    if part.name.endswith("forearm"):
        return SKIN
    return JACKET if part.name.endswith("arm") else TROUSERS


def _solid(part: Geom) -> Mesh:
    if part.mesh is not None:
        return read_mesh(part.mesh)
    x, y, z = part.size
    if part.shape is ShapeKind.HULL:
        return _hull(np.array(part.points))
    if part.shape is ShapeKind.BOX:
        return bevelled_box(part.size, (0.0, 0.0, 0.0))
    if part.shape is ShapeKind.SPHERE:
        return _ball(x / 2)
    if part.shape is ShapeKind.CYLINDER:
        return cone((0.0, 0.0, -z / 2), (0.0, 0.0, z / 2), (x / 2, x / 2), 24)
    half = max(x - y, 0.01) / 2
    bar = cone((-half, 0.0, 0.0), (half, 0.0, 0.0), (y / 2, y / 2))
    ends = (_ball(y / 2).moved((sign * half, 0.0, 0.0)) for sign in (-1.0, 1.0))
    return joined(bar, *ends)


def _hull(points: FloatArray) -> Mesh:
    """Return the surface of the solid around points."""
    found = ConvexHull(points)
    corners = found.simplices.copy()
    ways = np.cross(
        points[corners[:, 1]] - points[corners[:, 0]], points[corners[:, 2]] - points[corners[:, 0]]
    )
    inward = (ways * found.equations[:, :3]).sum(axis=1) < 0.0
    corners[inward] = corners[inward][:, ::-1]
    return flat(points, corners.astype(np.uint32))


def _ball(radius: float) -> Mesh:
    ball = sphere(20)
    return Mesh(radius * ball.points, ball.normals, ball.faces)


def _turned(mesh: Mesh, yaw: float) -> Mesh:
    cos, sin = math.cos(yaw), math.sin(yaw)
    turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    return Mesh(mesh.points @ turn.T, mesh.normals @ turn.T, mesh.faces)
