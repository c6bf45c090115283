"""Mesh of a file, as it is drawn: in metres, with normals, in the frame of what it shows."""

import numpy as np

from labcrane import DeviceError
from labcrane.machines import MeshError, MeshFile, Surface, in_frame, read_surface, turned
from labcrane_view.scene.mesh import Mesh, flat

ROUGH = 1e-6


def read_mesh(asked: MeshFile) -> Mesh:
    """Return a mesh in the frame of the link or thing, in metres.

    Raises
    ------
    DeviceError
        The file cannot be read, or holds no triangles.
    """
    try:
        mesh = _drawn(read_surface(asked.file))
    except MeshError as error:
        raise DeviceError(str(error)) from error
    return Mesh(in_frame(asked, mesh.points), mesh.normals @ turned(asked.turn_deg).T, mesh.faces)


Paint = tuple[float, float, float, float]


def painted(asked: MeshFile, usual: Paint) -> Paint:
    """Return the colour of a mesh: its own, or the usual one."""
    return usual if asked.colour is None else (*asked.colour, 1.0)


def _drawn(surface: Surface) -> Mesh:
    """Return what is drawn: flat where the file has no normals."""
    points, faces = surface.points, surface.faces.astype(np.uint32)
    if surface.normals is None:
        return flat(points, faces)
    lengths = np.linalg.norm(surface.normals, axis=1, keepdims=True)
    if (lengths < ROUGH).any():
        return flat(points, faces)
    return Mesh(points, surface.normals / lengths, faces)
