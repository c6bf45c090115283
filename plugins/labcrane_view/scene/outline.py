"""The outermost points of what is drawn: its box in a picture needs no others."""

import math
from collections.abc import Sequence

import numpy as np

from labcrane import FloatArray
from labcrane.machines import Body, Geom, PlacedObject
from labcrane_view.scene.body import body_mesh
from labcrane_view.scene.things import pieces

DIRECTIONS = 1024
"""In which the outermost point is kept: no point that is left out sticks out by more than a
thousandth of the size."""


def of_body(body: Body) -> FloatArray:
    """Return those of a body of the machine, in its frame, in metres, shape ``(n, 3)``."""
    return outermost(body_mesh(body).points)


def of_segment(thing: PlacedObject, parts: Sequence[Geom]) -> FloatArray:
    """Return those of a thing's segment, in the frame in which it moves, shape ``(n, 3)``."""
    return outermost(np.vstack([mesh.points for mesh, _ in pieces(thing, parts)]))


def outermost(points: FloatArray) -> FloatArray:
    """Return the points that are outermost in some direction, shape ``(n, 3)``."""
    found = np.unique(points, axis=0)
    if len(found) <= DIRECTIONS:
        return found
    step = np.arange(DIRECTIONS) + 0.5  # a spiral over the sphere, its turns evenly spaced
    z = 1.0 - 2.0 * step / DIRECTIONS
    around, aside = math.pi * (1.0 + math.sqrt(5.0)) * step, np.sqrt(1.0 - z * z)
    ways = np.stack([aside * np.cos(around), aside * np.sin(around), z], axis=1)
    kept = sorted({int(np.argmax(found @ way)) for way in ways})
    return np.asarray(found[kept])
