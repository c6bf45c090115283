"""Collision geometry of a mesh: the convex pieces that it consists of."""

import math
from collections.abc import Iterator

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, QhullError

from labcrane.machines.meshes.mesh_file import MeshFile
from labcrane.machines.meshes.reader import read_surface
from labcrane.machines.meshes.surface import Corners, MeshError
from labcrane.types import FloatArray

HOLLOW = 0.01
"""Share of the solid around a piece that may not be the piece's own: corners are rounded."""

MOST = 64
"""Solids of one mesh: each is looked at in every tick."""


def read_solids(asked: MeshFile) -> list[FloatArray]:
    """Return the corners of each piece of a mesh, in the frame of what it shows, in metres.

    A piece is what hangs together by its corners. Pieces may touch and stand in each other, and
    each must be closed and without hollows: the solid around its corners is then the piece itself.

    Raises
    ------
    MeshError
        The file cannot be read, has more than :data:`MOST` pieces, or a piece is open or has
        hollows.
    """
    surface = read_surface(asked.file)
    found = [
        _solid(asked, number, surface.points, faces)
        for number, faces in enumerate(_pieces(surface.points, surface.faces), start=1)
    ]
    if len(found) > MOST:
        raise MeshError(
            f"mesh {str(asked.file)!r} has {len(found)} pieces, but contact allows {MOST} at most; "
            "join pieces that are one solid, or remove pieces that need no contact"
        )
    return found


def in_frame(asked: MeshFile, points: FloatArray) -> FloatArray:
    """Return points of a file in the frame of what it shows.

    Parameters
    ----------
    points
        In the file's unit and frame, shape ``(n, 3)``.

    Returns
    -------
    FloatArray
        In metres, shape ``(n, 3)``.
    """
    placed: FloatArray = asked.scale * points @ turned(asked.turn_deg).T + np.array(asked.position)
    return placed


def turned(angles_deg: tuple[float, float, float]) -> FloatArray:
    """Return the rotation about x, then y, then z, shape ``(3, 3)``.

    Parameters
    ----------
    angles_deg
        About each of the three, in degrees.
    """
    whole = np.eye(3)
    for axis, angle in enumerate(angles_deg):
        c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
        one, two = (axis + 1) % 3, (axis + 2) % 3
        turn = np.eye(3)
        turn[one, one], turn[one, two], turn[two, one], turn[two, two] = c, -s, s, c
        whole = turn @ whole
    return whole


def _pieces(points: FloatArray, faces: Corners) -> Iterator[Corners]:
    """Yield the triangles of each piece.

    By the file's own numbers of corners, so that solids that were cut from one another stay two
    though their corners are in the same places; by places where triangles have corners of their
    own, as in STL and wherever every triangle has its normal.
    """
    if not _closed(faces):
        places = np.unique(points, axis=0, return_inverse=True)[1].reshape(-1)
        faces = places[faces]
        first = np.unique(places, return_index=True)[1]
    else:
        first = np.arange(len(points))
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]]])
    links = coo_array((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(len(first),) * 2)
    of_corner = connected_components(links, directed=False)[1]
    own = of_corner[faces[:, 0]]
    for label in dict.fromkeys(own.tolist()):
        yield first[faces[own == label]]


def _closed(faces: Corners) -> bool:
    """Return whether every edge is between two triangles."""
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    return bool((np.unique(edges, axis=0, return_counts=True)[1] == 2).all())  # noqa: PLR2004


def _solid(asked: MeshFile, number: int, points: FloatArray, faces: Corners) -> FloatArray:
    which = f"piece {number} of mesh {str(asked.file)!r}"
    corners = points[faces]
    try:
        around = ConvexHull(np.unique(corners.reshape(-1, 3), axis=0))
    except QhullError as error:
        raise MeshError(f"{which} is flat; a mesh for contact needs a thickness") from error
    # The divergence theorem, from the middle: what is open has less than the solid around it.
    own = abs(float(np.linalg.det(corners - around.points.mean(axis=0)).sum())) / 6.0
    if abs(own / around.volume - 1.0) > HOLLOW:
        raise MeshError(
            f"{which} is open or has hollows: it has {100.0 * own / around.volume:.0f} % of the "
            "volume of the solid around it; close it, or cut it into solids without hollows"
        )
    return in_frame(asked, around.points[around.vertices])
