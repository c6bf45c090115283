"""Surface of a mesh: triangles, as its file has them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from labcrane.limits import check_size
from labcrane.types import FloatArray

Corners = npt.NDArray[np.int64]


class MeshError(ValueError):
    """A file is not the mesh that it should be; the message goes on after its name."""


@dataclass(frozen=True, slots=True)
class Surface:
    """Triangles of a file, in its units and along its axes.

    Attributes
    ----------
    points
        Shape ``(n, 3)``.
    normals
        A direction for each point, of any length, shape ``(n, 3)``; None where the file has none.
    faces
        Corners of each triangle, counterclockwise from outside, shape ``(m, 3)``.
    """

    points: FloatArray
    normals: FloatArray | None
    faces: Corners

    def __post_init__(self) -> None:
        for numbers in (self.points, self.normals):
            if numbers is not None and not np.isfinite(numbers).all():
                raise MeshError("has points or normals that are not finite numbers")
        check_corners(self.faces, len(self.points))


def doubles(numbers: npt.ArrayLike) -> FloatArray:
    """Return numbers with 64 bits; without warnings for NaN, which :class:`Surface` refuses."""
    with np.errstate(invalid="ignore"):
        return np.asarray(numbers).astype(np.float64)


def floats(words: Sequence[str] | Sequence[bytes], line: int) -> list[float]:
    """Return the numbers that words of a line are, or raise :class:`MeshError`."""
    try:
        return [float(word) for word in words]
    except ValueError as error:
        raise MeshError(f"has a value that is not a number in line {line}") from error


def check_corners(corners: Corners, count: int) -> None:
    """Raise :class:`MeshError` where a corner is not one of ``count`` points."""
    if corners.size and (corners.min() < 0 or corners.max() >= count):
        raise MeshError(f"has triangles with corners that are not among its {count} points")


def check_triangles(count: int) -> None:
    """Raise :class:`labcrane.limits.LimitError` for more triangles than a mesh may have."""
    check_size(count, "triangles of a mesh", "the mesh")


def fans(polygons: Sequence[int], corners: Corners) -> Corners:
    """Return polygons as triangles about their first corners.

    Parameters
    ----------
    polygons
        How many corners each has, three at least.
    corners
        Those of all polygons, one after the other.

    Returns
    -------
    Corners
        Shape ``(m, 3)``.
    """
    counts = np.asarray(polygons, np.int64)
    check_triangles(int((counts - 2).sum()))
    starts = np.cumsum(counts) - counts
    first = np.repeat(starts, counts - 2)
    within = np.arange(len(first)) - np.repeat(np.cumsum(counts - 2) - (counts - 2), counts - 2)
    places = np.stack([first, first + within + 1, first + within + 2], axis=1)
    found: Corners = corners[places]
    return found
