"""Cab around a camera: pillars, the roof's edge and the sill of a window, as from the seat."""

from labcrane_view.scene.mesh import Mesh, cone, joined

AHEAD_M = 0.9
"""From the eye to the window."""

PILLAR_M, EDGE_M = 0.038, 0.05
"""Radii of the pillars, and of roof and sill."""

INSET, LOW, HIGH = 0.90, 0.93, 0.95
"""Positions of the pillars, as proportions of half the picture's width and height."""

LEAN_M = 0.10
"""Additional distance between the pillars at the sill."""

CLEAR = 0.80
"""Proportion of half the picture, about its middle, that the cab does not hide."""


def window(half_width: float, half_height: float) -> Mesh:
    """Return the frame of a window, in a camera's own frame: x right, y ahead, z up, in metres.

    Parameters
    ----------
    half_width, half_height
        Of the picture at a distance of one.
    """
    wide, low, high = (
        AHEAD_M * share * half
        for share, half in ((INSET, half_width), (LOW, half_height), (HIGH, half_height))
    )
    bars = []
    for side in (-1.0, 1.0):
        foot, top = (side * (wide + LEAN_M), AHEAD_M, -1.1 * low), (side * wide, AHEAD_M, high)
        bars.append(cone(foot, top, (PILLAR_M, PILLAR_M), 14))
    for up, out in ((high + 0.5 * EDGE_M, wide), (-low - 0.5 * EDGE_M, wide + LEAN_M)):
        bars.append(cone((-1.4 * out, AHEAD_M, up), (1.4 * out, AHEAD_M, up), (EDGE_M, EDGE_M), 14))
    return joined(*bars)
