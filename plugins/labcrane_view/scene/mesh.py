"""Triangles: small solids, made of numbers."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from labcrane import FloatArray

Faces = npt.NDArray[np.uint32]


@dataclass(frozen=True)
class Mesh:
    """Triangles with a normal for each corner.

    Attributes
    ----------
    points, normals
        Shape ``(n, 3)``, in metres.
    faces
        Corners of each triangle, counterclockwise from outside, shape ``(m, 3)``.
    """

    points: FloatArray
    normals: FloatArray
    faces: Faces

    def moved(self, offset: tuple[float, float, float]) -> "Mesh":
        """Return the mesh somewhere else."""
        return Mesh(self.points + np.array(offset), self.normals, self.faces)


def joined(*meshes: Mesh) -> Mesh:
    """Return several meshes as one."""
    starts = np.cumsum([0, *(len(mesh.points) for mesh in meshes)])
    faces = [mesh.faces + start for mesh, start in zip(meshes, starts[:-1], strict=True)]
    return Mesh(
        np.vstack([mesh.points for mesh in meshes]),
        np.vstack([mesh.normals for mesh in meshes]),
        np.vstack(faces).astype(np.uint32),
    )


def flat(points: FloatArray, faces: Faces) -> Mesh:
    """Return a mesh whose faces are flat: every triangle has corners of its own."""
    corners = points[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = normals / np.where(lengths > 0.0, lengths, 1.0)
    order = np.arange(3 * len(faces), dtype=np.uint32).reshape(-1, 3)
    return Mesh(corners.reshape(-1, 3), np.repeat(normals, 3, axis=0), order)


def sphere(slices: int = 32) -> Mesh:
    """Return a sphere of radius 1."""
    stacks = slices // 2
    down, round_ = np.linspace(0.0, np.pi, stacks + 1), np.linspace(0.0, 2.0 * np.pi, slices + 1)
    polar, around = np.meshgrid(down, round_, indexing="ij")
    points = np.stack(
        [np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)], axis=-1
    ).reshape(-1, 3)
    return Mesh(points, points, _grid_faces(stacks, slices))


def _grid_faces(rows: int, columns: int) -> Faces:
    """Return two triangles for each cell of a grid of points, row by row."""
    row, column = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    a = (row * (columns + 1) + column).ravel()
    b = a + columns + 1
    faces = np.stack([np.stack([a, b, b + 1], 1), np.stack([a, b + 1, a + 1], 1)], 1)
    return faces.reshape(-1, 3).astype(np.uint32)


def cone(
    start: tuple[float, float, float],
    end: tuple[float, float, float],
    radii: tuple[float, float],
    sides: int = 16,
) -> Mesh:
    """Return a closed cone or cylinder between two points, with radii in metres at both."""
    low, high = np.array(start), np.array(end)
    axis = (high - low) / np.linalg.norm(high - low)
    other = np.eye(3)[int(np.argmin(np.abs(axis)))]
    one = np.cross(axis, other)
    one = one / np.linalg.norm(one)
    two = np.cross(axis, one)
    angle = np.linspace(0.0, 2.0 * np.pi, sides + 1)
    ring = np.cos(angle)[:, None] * one + np.sin(angle)[:, None] * two
    slope = (radii[0] - radii[1]) / float(np.linalg.norm(high - low))
    normals = (ring + slope * axis) / math.hypot(1.0, slope)
    mantle = Mesh(
        np.vstack([low + radii[0] * ring, high + radii[1] * ring]),
        np.vstack([normals, normals]),
        _grid_faces(1, sides)[:, ::-1].copy(),
    )
    return joined(mantle, _disc(low, -axis, radii[0] * ring), _disc(high, axis, radii[1] * ring))


def _disc(centre: FloatArray, normal: FloatArray, ring: FloatArray) -> Mesh:
    points = np.vstack([centre, centre + ring])
    rim = np.arange(1, len(ring), dtype=np.uint32)
    faces = np.stack([np.zeros_like(rim), rim, rim + 1], axis=1)
    if np.cross(ring[0], ring[1]) @ normal < 0.0:
        faces = faces[:, ::-1].copy()
    return Mesh(points, np.tile(normal, (len(points), 1)), faces)


def bevelled_box(size: tuple[float, float, float], centre: tuple[float, float, float]) -> Mesh:
    """Return a box, with its long edges cut off: a welded beam rather than a brick."""
    half = np.array(size) / 2.0
    along = int(np.argmax(half))
    wide, high = (axis for axis in range(3) if axis != along)
    cut = 0.22 * min(half[wide], half[high])
    a, b = half[wide], half[high]
    outline = [(a - cut, -b), (a, -b + cut), (a, b - cut), (a - cut, b)]
    outline += [(-x, -y) for x, y in outline]
    points = np.zeros((2 * len(outline), 3))
    for end, sign in enumerate((-1.0, 1.0)):
        for number, (x, y) in enumerate(outline):
            point = points[end * len(outline) + number]
            point[along], point[wide], point[high] = sign * half[along], x, y
    count = len(outline)
    faces = []
    for number in range(count):
        after = (number + 1) % count
        faces += [(number, after, count + after), (number, count + after, count + number)]
    faces += [(0, n + 1, n) for n in range(1, count - 1)]
    faces += [(count, count + n, count + n + 1) for n in range(1, count - 1)]
    return _outward(points, np.array(faces, dtype=np.uint32)).moved(centre)


def _outward(points: FloatArray, faces: Faces) -> Mesh:
    """Return a convex body about the origin with all its faces turned outwards."""
    corners = points[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = np.einsum("ij,ij->i", normals, corners.mean(axis=1)) < 0.0
    turned = faces.copy()
    turned[inward] = turned[inward][:, ::-1]
    return flat(points, turned)
