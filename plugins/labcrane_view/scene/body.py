"""Body of a machine as it is drawn: its mesh, a grapple with tines, or a welded beam."""

import math
from itertools import pairwise

import numpy as np

from labcrane.machines import Body
from labcrane_view.scene.mesh import Mesh, bevelled_box, cone, joined
from labcrane_view.scene.mesh_reader import read_mesh

GRAPPLE = "grapple"

TURN = np.linspace(math.radians(55.0), math.radians(-78.0), 7)
"""Along a tine, from its hinge to its point: the angle from level, about the grapple's middle."""


def body_mesh(body: Body) -> Mesh:
    """Return what is drawn of a body, in its frame; never more than its box holds."""
    if body.mesh is not None:
        return read_mesh(body.mesh)
    if body.name == GRAPPLE and body.moves:
        return _grapple(*body.size).moved(body.centre)
    return bevelled_box(body.size, body.centre)


def _grapple(wide: float, deep: float, high: float) -> Mesh:
    """Return a rotator, a cross beam, and two pairs of tines that meet below a log."""
    thick = 0.055 * wide
    parts = [
        cone((0.0, 0.0, 0.28 * high), (0.0, 0.0, 0.5 * high), (0.16 * wide, 0.12 * wide), 16),
        bevelled_box((0.62 * wide, 0.62 * deep, 0.12 * high), (0.0, 0.0, 0.25 * high)),
    ]
    reach, drop = 0.5 * wide - thick, 0.5 * high - thick
    for side in (-1.0, 1.0):
        for place in (-0.32, -0.12) if side < 0.0 else (0.32, 0.12):
            y = place * deep
            line = [
                (side * reach * math.cos(turn) ** 0.6, y, drop * math.sin(turn)) for turn in TURN
            ]
            widths = np.linspace(1.0, 0.35, len(line)) * thick
            for number, (start, end) in enumerate(pairwise(line)):
                radii = (float(widths[number]), float(widths[number + 1]))
                parts.append(cone(start, end, radii, 8))
        hinge = (side * reach * math.cos(TURN[0]) ** 0.6, 0.0, drop * math.sin(TURN[0]))
        along = (0.0, 0.4 * deep, 0.0)
        low, high_end = (tuple(np.add(hinge, np.multiply(sign, along))) for sign in (-1.0, 1.0))
        parts.append(cone(low, high_end, (thick, thick), 10))
    return joined(*parts)
