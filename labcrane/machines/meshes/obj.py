"""OBJ: points, normals and polygons, line by line."""

import io
from array import array
from collections.abc import Iterator

import numpy as np

from labcrane.machines.meshes.surface import (
    Corners,
    MeshError,
    Surface,
    check_corners,
    check_triangles,
    fans,
    floats,
)
from labcrane.types import FloatArray

OTHERS = frozenset(
    b"vt vp p l o g s mg mtllib usemtl usemap maplib bevel c_interp d_interp lod shadow_obj "
    b"trace_obj".split()
)
"""Keywords that do not concern triangles; a line with an unknown keyword is damaged."""
NORMALS = 3
"""Where a corner names its normal: point, texture, normal."""


def read_obj(data: bytes) -> Surface:
    """Return the polygons of an OBJ file as triangles.

    Where every corner names a normal, every corner becomes a point of its own.

    Raises
    ------
    MeshError
        A line does not belong to an OBJ file with flat polygons, or refers to missing points.
    """
    points, normals, corners, named = array("d"), array("d"), array("q"), array("q")
    polygons = array("q")
    triangles = 0
    for number, words in _lines(data):
        first = words[0]
        if first in {b"v", b"vn"}:
            # A point may have a weight or a colour behind it.
            if len(words) < 4 or (first == b"vn" and len(words) > 4):  # noqa: PLR2004 - x, y, z
                raise MeshError(f"has a point or normal without three numbers in line {number}")
            (points if first == b"v" else normals).extend(floats(words[1:4], number))
        elif first == b"f":
            triangles += len(words) - 3
            check_triangles(triangles)
            polygons.append(len(words) - 1)
            for word in words[1:]:
                place, normal = _corner(word, number, len(points) // 3, len(normals) // 3)
                corners.append(place)
                named.append(normal)
            if len(words) < 4:  # noqa: PLR2004 - three corners
                raise MeshError(f"has a polygon with fewer than three corners in line {number}")
        elif first not in OTHERS:
            raise MeshError(
                f"has {first[:20].decode('latin-1')!r} in line {number}, which does not describe "
                "flat polygons"
            )
    return _surface(_rows(points), _rows(normals), polygons, np.array([corners, named], np.int64))


def _surface(
    points: FloatArray, normals: FloatArray, polygons: "array[int]", named: Corners
) -> Surface:
    places, directions = named
    check_corners(places, len(points))
    if not len(normals) or (directions == _NONE).any():
        return Surface(points, None, fans(polygons, places))
    check_corners(directions, len(normals))
    faces = fans(polygons, np.arange(len(places)))
    return Surface(points[places], normals[directions], faces)


_NONE = np.iinfo(np.int64).max
"""The normal of a corner that names none."""


def _rows(numbers: "array[float]") -> FloatArray:
    return np.array(numbers, np.float64).reshape(-1, 3)


def _lines(data: bytes) -> Iterator[tuple[int, list[bytes]]]:
    """Yield the words of each line that has some, with the number of its last line."""
    begun: list[bytes] = []
    for number, line in enumerate(io.BytesIO(data), start=1):
        words = line.partition(b"#")[0].split()
        if words and words[-1].endswith(b"\\"):  # goes on in the next line
            begun += [*words[:-1], words[-1][:-1]]
            continue
        if whole := [word for word in (*begun, *words) if word]:
            yield number, whole
        begun = []


def _corner(word: bytes, number: int, points: int, normals: int) -> tuple[int, int]:
    """Return the numbers of a corner's point and normal, counted from 0."""
    parts = word.split(b"/", NORMALS)
    try:
        normal = b"/".join(parts[NORMALS - 1 :])  # a fourth part makes no number of it
        return _place(parts[0], points), _place(normal, normals) if normal else int(_NONE)
    except ValueError as error:
        raise MeshError(f"has a corner in line {number} that refers to no point") from error


def _place(word: bytes, count: int) -> int:
    """Return a number counted from 0: files count from 1, or backwards from -1."""
    at = int(word)
    place = at - 1 if at > 0 else count + at
    if at == 0 or abs(at) >= _NONE or place < 0:
        raise ValueError
    return place
