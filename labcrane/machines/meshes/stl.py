"""STL: triangles with a normal each, packed or written out."""

from collections.abc import Iterator

import numpy as np

from labcrane.machines.meshes.surface import MeshError, Surface, check_triangles, doubles, floats

HEAD = 84
"""Bytes before the first triangle: a title of 80, and how many there are."""
ROW = np.dtype([("normal", "<f4", 3), ("points", "<f4", (3, 3)), ("attribute", "<u2")])
FACET = ("facet", "outer", "vertex", "vertex", "vertex", "endloop", "endfacet")
"""First words of the lines of a triangle."""
NUMBERS = {"facet": ("normal", 5), "vertex": ("", 4), "outer": ("loop", 2)}
"""The second word of a line, and how many words it has."""


def read_stl(data: bytes) -> Surface:
    """Return the triangles of an STL file.

    Raises
    ------
    MeshError
        It is not an STL file, is cut off, or has values that are not numbers.
    """
    count = int.from_bytes(data[80:HEAD], "little")
    if len(data) == HEAD + count * ROW.itemsize and len(data) >= HEAD:
        check_triangles(count)
        rows = np.frombuffer(data, ROW, offset=HEAD)
        return _surface(rows["normal"], rows["points"])
    if data.lstrip()[:5].lower() == b"solid":
        return _written(data)
    room = max(0, len(data) - HEAD) / ROW.itemsize
    raise MeshError(f"states that it has {count} triangles but has room for {room:g}")


def _surface(normals: "np.typing.ArrayLike", points: "np.typing.ArrayLike") -> Surface:
    corners = doubles(points).reshape(-1, 3)
    each = np.repeat(doubles(normals).reshape(-1, 3), 3, axis=0)
    return Surface(corners, each, np.arange(len(corners)).reshape(-1, 3))


def _written(data: bytes) -> Surface:
    normals: list[float] = []
    points: list[float] = []
    at, inside = 0, False
    for number, words in _lines(data):
        first = words[0].lower()
        if first in {"solid", "endsolid"} and at == 0 and inside is (first == "endsolid"):
            inside = not inside
            continue
        if not inside or first != FACET[at]:
            wanted = " or ".join(("endsolid", FACET[at])[at > 0 :]) if inside else "solid"
            raise MeshError(f"has {first[:20]!r} in line {number} instead of {wanted}")
        if first in NUMBERS:
            second, count = NUMBERS[first]
            if len(words) != count or second not in {"", words[1].lower()}:
                raise MeshError(f"has no {' '.join((first, second)).strip()} in line {number}")
        if first in {"facet", "vertex"}:
            numbers = normals if first == "facet" else points
            numbers += floats(words[-3:], number)
        at = (at + 1) % len(FACET)
        check_triangles(len(normals) // 3)
    if inside:
        raise MeshError("is cut off: it has no endsolid at its end")
    return _surface(np.array(normals), np.array(points))


def _lines(data: bytes) -> Iterator[tuple[int, list[str]]]:
    for number, line in enumerate(data.decode("latin-1").split("\n"), start=1):
        if words := line.split():
            yield number, words
