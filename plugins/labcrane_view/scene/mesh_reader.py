"""Mesh of a file, as it is drawn: in metres, with normals, in the frame of what it shows."""

import math

import numpy as np

from labcrane import DeviceError, FloatArray
from labcrane.machines import MeshError, MeshFile, Surface, read_surfaces
from labcrane_view.scene.mesh import Mesh, flat, joined

ROUGH = 1e-6


def read_mesh(asked: MeshFile) -> Mesh:
    """Return a mesh in the frame of the link or thing, in metres.

    Raises
    ------
    DeviceError
        The file cannot be read, or holds no triangles.
    """
    try:
        surfaces = read_surfaces(asked.file)
    except MeshError as error:
        raise DeviceError(str(error)) from error
    mesh = joined(*map(_part, surfaces))
    turn = turned(asked.turn_deg)
    points = asked.scale * mesh.points @ turn.T + np.array(asked.position)
    return Mesh(points, mesh.normals @ turn.T, mesh.faces)


Paint = tuple[float, float, float, float]


def painted(asked: MeshFile, usual: Paint) -> Paint:
    """Return the colour of a mesh: its own, or the usual one."""
    return usual if asked.colour is None else (*asked.colour, 1.0)


def turned(angles_deg: tuple[float, float, float]) -> FloatArray:
    """Return the rotation about x, then y, then z, shape ``(3, 3)``."""
    whole = np.eye(3)
    for axis, angle in enumerate(angles_deg):
        c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
        one, two = (axis + 1) % 3, (axis + 2) % 3
        turn = np.eye(3)
        turn[one, one], turn[one, two], turn[two, one], turn[two, two] = c, -s, s, c
        whole = turn @ whole
    return whole


def _part(surface: Surface) -> Mesh:
    """Return what is drawn: flat where the file has no normals."""
    points, faces = surface.points, surface.faces.astype(np.uint32)
    if surface.normals is None:
        return flat(points, faces)
    lengths = np.linalg.norm(surface.normals, axis=1, keepdims=True)
    if (lengths < ROUGH).any():
        return flat(points, faces)
    return Mesh(points, surface.normals / lengths, faces)
