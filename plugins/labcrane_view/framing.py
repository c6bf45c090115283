"""Framing of a camera: turned, and as wide as it must be, to hold what must be seen."""

import math

import numpy as np

from labcrane import FloatArray, ProtocolError, Run
from labcrane.machines import link_frames
from labcrane_view.areas import axes_of

ABOVE = 2.2
"""Metres above a target, and between two of them, through which the tip is carried."""

MARGIN = 1.06
"""Margin of the picture around the points that it must show."""

WIDEST_DEG = 120.0
"""Horizontal field of view beyond which a flat picture is stretched at its edges."""

TURNS = 60


def must_be_seen(run: Run) -> FloatArray:
    """Return points around all targets, above them, and around the tip at rest, shape ``(n, 3)``.

    Empty when the tasks do not say where their targets are.
    """
    if not run.places:
        return np.zeros((0, 3))
    sides = np.vstack([np.eye(3), -np.eye(3)])
    balls = [np.array(place.centre) + place.radius * sides for place in run.places]
    above = np.array([place.centre for place in run.places]) + ABOVE * np.eye(3)[2]
    tip = link_frames(run.machine, run.machine.rest)[-1][:3, 3]
    return np.vstack([*balls, above, tip])


def framed(
    name: str, eye: FloatArray, points: FloatArray, aspect: float
) -> tuple[FloatArray, float]:
    """Return where a camera at ``eye`` looks, and its horizontal field of view in degrees.

    Parameters
    ----------
    points
        What it must hold, in metres, shape ``(n, 3)``.
    aspect
        Width of the picture by its height.

    Raises
    ------
    ProtocolError
        There is nothing to hold, or no picture holds it all.
    """
    if not len(points):
        raise ProtocolError(
            f"camera {name!r} looks at the targets, and no task of this study says where its "
            "targets are; write look: as a point, and fov_deg"
        )
    rays = points - eye
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    forward, half = rays.mean(axis=0), math.inf
    for _ in range(TURNS):
        axes = axes_of(eye, eye + forward)
        seen = rays @ axes.T
        if (seen[:, 1] <= 0.0).any():
            half = math.inf
            break
        across, up = seen[:, 0] / seen[:, 1], seen[:, 2] / seen[:, 1]
        half = MARGIN * max(np.abs(across).max(), aspect * np.abs(up).max())
        aside, above = (across.min() + across.max()) / 2, (up.min() + up.max()) / 2
        forward = axes[1] + aside * axes[0] + above * axes[2]
        forward /= np.linalg.norm(forward)
    fov_deg = math.degrees(2.0 * math.atan(half))
    if fov_deg > WIDEST_DEG:
        raise ProtocolError(
            f"camera {name!r} at ({', '.join(f'{each:g}' for each in eye)}) m is too close to the "
            f"targets to hold them all within {WIDEST_DEG:g} degrees; move its eye back"
        )
    return eye + forward, fov_deg
