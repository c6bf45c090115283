"""Reads STL, OBJ and glTF with the renderer's own reader (assimp)."""

import math

import numpy as np
from panda3d import core

from labcrane import DeviceError, FloatArray
from labcrane.machines import MeshFile
from labcrane_view.scene.mesh import Faces, Mesh, flat, joined

ROUGH = 1e-6


def read_mesh(asked: MeshFile) -> Mesh:
    """Return a mesh in the frame of the link or thing, in metres.

    Raises
    ------
    DeviceError
        The file cannot be read, or holds no triangles.
    """
    core.load_prc_file_data("labcrane meshes", "load-file-type p3assimp")
    path = core.Filename.from_os_specific(str(asked.file))
    path.make_absolute()
    options = core.LoaderOptions(core.LoaderOptions.LF_no_cache)
    root = core.Loader.get_global_ptr().load_sync(path, options)
    if root is None:
        raise DeviceError(
            f"mesh {str(asked.file)!r} cannot be read; write it again as STL, OBJ or glTF 2"
        )
    top = core.NodePath(root)
    try:
        parts = [
            _part(node.node().get_geom(number), node.get_mat(top))
            for node in top.find_all_matches("**/+GeomNode")
            for number in range(node.node().get_num_geoms())
        ]
    except ValueError as error:
        raise DeviceError(f"mesh {str(asked.file)!r} {error}; export it again") from error
    whole = [part for part in parts if len(part.faces)]
    if not whole:
        raise DeviceError(f"mesh {str(asked.file)!r} holds no triangles; export its surface")
    mesh = joined(*whole)
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


def _part(geometry: "core.Geom", place: "core.LMatrix4f") -> Mesh:
    plain = geometry.decompose()
    table = plain.get_vertex_data().convert_to(core.GeomVertexFormat.get_v3n3())
    rows = np.frombuffer(bytes(memoryview(table.get_array(0)).cast("B")), np.float32)
    values = rows.reshape(-1, 6).astype(np.float64)
    if not np.isfinite(values).all():
        raise ValueError("has points or normals that are no finite numbers")
    matrix = np.array([[place[row][column] for column in range(4)] for row in range(4)])
    points = values[:, :3] @ matrix[:3, :3] + matrix[3, :3]  # rows times matrix, as Panda has it
    normals = values[:, 3:] @ matrix[:3, :3]
    faces = np.vstack([np.zeros((0, 3), np.uint32), *_faces(plain)]).astype(np.uint32)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    if (lengths < ROUGH).any():  # the file has none
        return flat(points, faces)
    return Mesh(points, normals / lengths, faces)


def _faces(geometry: "core.Geom") -> list[Faces]:
    found = []
    for number in range(geometry.get_num_primitives()):
        primitive = geometry.get_primitive(number)
        if not isinstance(primitive, core.GeomTriangles):
            continue  # lines and points
        corners = [primitive.get_vertex(at) for at in range(primitive.get_num_vertices())]
        found.append(np.array(corners, np.uint32).reshape(-1, 3))
    return found
