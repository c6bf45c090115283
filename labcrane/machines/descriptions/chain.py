"""Chain of joint axes as a file describes it, and the machine that has the same kinematics.

Everything is given at the pose where the file's joint angles are zero, in the file's base frame:
points on the axes, their directions, and the tip. From these follow the Denavit-Hartenberg figures
of a slewing base with pitch joints (J. Denavit and R. S. Hartenberg, J. Appl. Mech. 22, 1955), or
which axis is in the way. Where the file turns a joint the other way round, its angle here has
the other sign: positive slew is to the left, positive pitch is down.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from labcrane.machines.machine import UPWARD_TO_LEVEL
from labcrane.types import FloatArray

ROUNDED = 1e-3
"""How far off its place a file may have an axis, in rad and in m: pi/2 is often 1.5708."""

NEARLY = 1e-6
"""How far, in m and as a sine, what is in its place may be from it: rounding of arithmetic."""

ROUNDING = 1e-12

CENTRE_DECIMALS = 12
"""Of a centre of mass in m: Bullet refuses a body whose inertia the rest makes unsymmetric."""


class ChainError(ValueError):
    """The joints of a file are not a slewing base with pitch joints.

    ``name`` is the name that is missing in the file, if that is the reason.
    """

    def __init__(self, message: str, *, name: str = "") -> None:
        super().__init__(message)
        self.name = name


@dataclass(frozen=True)
class Mass:
    """The parts that move with one joint and no further one.

    Attributes
    ----------
    mass
        In kg.
    centre
        Of mass, in the base frame at zero, in m, shape ``(3,)``.
    inertia
        About the centre, in the base frame's directions, in kg m², shape ``(3, 3)``.
    """

    mass: float
    centre: FloatArray
    inertia: FloatArray


@dataclass(frozen=True)
class LinkMesh:
    """Mesh of a link.

    Attributes
    ----------
    file, scale
        As a machine's YAML has them: a path, and metres per unit of the file.
    pose
        Where its origin is at zero in the base frame, shape ``(4, 4)``.
    """

    file: str
    scale: float
    pose: FloatArray


@dataclass(frozen=True)
class Axis:
    """One joint at zero.

    Attributes
    ----------
    name, called
        In the file, and in the study.
    point, direction
        A point on the axis in m, and its direction, shape ``(3,)`` each.
    limits
        Lowest and highest angle as the file counts, in rad.
    speed, effort
        Largest, in rad/s and N m.
    carries
        What moves with it.
    look
        The mesh of its link; None for a beam.
    """

    name: str
    called: str
    point: FloatArray
    direction: FloatArray
    limits: tuple[float, float]
    speed: float
    effort: float
    carries: Mass
    look: LinkMesh | None = None


def machine_fields(
    axes: Sequence[Axis], tip: FloatArray, rest_deg: dict[str, float], thickness: float
) -> dict[str, Any]:
    """Return the values of ``base_x`` and ``joints`` for a machine's YAML.

    Parameters
    ----------
    axes
        From the base outward, three or more.
    tip
        In the base frame at zero, in m, shape ``(3,)``.
    rest_deg
        Angles at which a session begins, by the study's names; 0, or the nearest limit, otherwise.
    thickness
        Of the beams that replace links without a mesh, in m.

    Raises
    ------
    ChainError
        An axis does not fit.
    """
    slew, *chain = axes
    across, ahead = _plane(slew, chain, tip)
    origin = slew.point - np.array([0.0, 0.0, slew.point[2]])

    def flat(point: FloatArray) -> tuple[float, float]:
        return float(ahead @ (point - origin)), float(point[2])

    ends = [flat(each.point) for each in chain] + [flat(tip)]
    radius, height = ends[0]
    if radius < -ROUNDED:
        raise ChainError(
            f"the axis of {chain[0].name!r} is {-radius:.3f} m behind that of {slew.name!r}, and "
            "must be over or before it"
        )
    turned = math.degrees(math.atan2(ahead[1], ahead[0]))
    foot = {"d": height, "a": max(radius, 0.0), "alpha_deg": UPWARD_TO_LEVEL, "offset_deg": turned}
    frame = np.column_stack([ahead, across, [0.0, 0.0, 1.0]])
    sign = math.copysign(1.0, slew.direction[2])
    far_end = _far_end(ahead, across, origin + max(radius, 0.0) * ahead + [0.0, 0.0, height])
    joints = [_joint(slew, sign, foot, frame, origin, far_end, rest_deg, thickness)]
    pitch = 0.0
    for each, near, far in zip(chain, ends, ends[1:], strict=False):
        out, down = far[0] - near[0], near[1] - far[1]
        length = math.hypot(out, down)
        now = math.atan2(down, out) if length > NEARLY else pitch
        link = {"a": length, "offset_deg": math.degrees(math.remainder(now - pitch, math.tau))}
        pitch = now
        along = math.cos(now) * ahead - math.sin(now) * frame[:, 2]
        turned_frame = np.column_stack([along, across, np.cross(along, across)])
        at = origin + near[0] * ahead + np.array([0.0, 0.0, near[1]])
        sign = math.copysign(1.0, float(each.direction @ across))
        far_end = _far_end(along, across, at + length * along)
        joints.append(_joint(each, sign, link, turned_frame, at, far_end, rest_deg, thickness))
    return {"base_x": float(slew.point[0]), "joints": joints}


def _plane(slew: Axis, chain: Sequence[Axis], tip: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the direction of pitch axes, and the horizontal one in which the arm points.

    Raises
    ------
    ChainError
        The joints do not move in one upright plane that turns with the first one.
    """
    if math.hypot(*slew.direction[:2]) > ROUNDED:
        raise ChainError(f"joint {slew.name!r} comes first and must slew about an upright axis")
    if abs(slew.point[1]) > ROUNDED:
        raise ChainError(
            f"the axis of {slew.name!r} is {slew.point[1]:.3f} m beside the base's x axis; move "
            "the base under it"
        )
    across = chain[0].direction * [1.0, 1.0, 0.0]
    across /= np.linalg.norm(across) or 1.0
    for each in chain:
        if abs(each.direction[2]) > ROUNDED:
            raise ChainError(
                f"joint {each.name!r} must pitch about a horizontal axis, like all joints but "
                "the first"
            )
        if np.linalg.norm(np.cross(each.direction, across)) > 2.0 * ROUNDED:
            raise ChainError(
                f"the axes of {chain[0].name!r} and {each.name!r} are not parallel, as those of "
                "pitch joints must be"
            )
    ahead = np.cross(across, [0.0, 0.0, 1.0])
    reach = float(ahead @ (chain[0].point - slew.point)), float(ahead @ (tip - slew.point))
    if reach[0] < -NEARLY or (abs(reach[0]) <= NEARLY and reach[1] < -NEARLY):
        across, ahead = -across, -ahead
    beside = float(across @ (tip - slew.point))
    if abs(beside) > ROUNDED:
        raise ChainError(
            f"the tip is {abs(beside):.3f} m beside the plane of the slew axis and must be in it; "
            "name another link as the tip"
        )
    return across, ahead


def rounding(axes: Sequence[Axis], tip: FloatArray) -> str:
    """Say how far off one upright plane the axes of a file are; nothing where they are in it."""
    slew, *chain = axes
    across, _ = _plane(slew, chain, tip)
    turned = [math.hypot(*slew.direction[:2])]
    turned += [float(np.linalg.norm(np.cross(each.direction, across))) for each in chain]
    beside = [abs(float(slew.point[1])), abs(float(across @ (tip - slew.point)))]
    if max(*turned, *beside) <= NEARLY:
        return ""
    return (
        f", whose axes are up to {math.degrees(max(turned)):.4f} degrees, and whose tip and slew "
        f"axis up to {1000.0 * max(beside):.2f} mm, off one upright plane, and are put into it"
    )


def _joint(
    axis: Axis,
    sign: float,
    figures: dict[str, float],
    frame: FloatArray,
    origin: FloatArray,
    far: FloatArray,
    rest_deg: dict[str, float],
    thickness: float,
) -> dict[str, Any]:
    lowest, highest = sorted(math.degrees(sign * angle) for angle in axis.limits)
    rest = rest_deg.get(axis.called, min(max(0.0, lowest), highest))
    centre = frame.T @ (axis.carries.centre - origin)
    inertia = frame.T @ axis.carries.inertia @ frame
    # What rounding leaves beside the diagonal would be taken for a turned body by engines.
    inertia[np.abs(inertia) < ROUNDING * np.trace(inertia)] = 0.0
    return {
        "name": axis.called,
        **figures,
        "range_deg": [lowest, highest],
        "speed_deg_s": math.degrees(axis.speed),
        "rest_deg": rest,
        "mass_kg": axis.carries.mass,
        "effort": axis.effort,
        "thickness": thickness,
        **({"mesh": _mesh(axis.look, far)} if axis.look else {}),
        "centre_m": np.round(centre, CENTRE_DECIMALS).tolist(),
        "inertia_kgm2": [
            *np.diag(inertia).tolist(), inertia[0, 1], inertia[0, 2], inertia[1, 2],
        ],
    }  # fmt: skip


def _far_end(along: FloatArray, across: FloatArray, at: FloatArray) -> FloatArray:
    """Return the DH frame at a link's far end: x along the link, z along the pitch axis."""
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([along, np.cross(across, along), across])
    pose[:3, 3] = at
    return pose


def _mesh(look: LinkMesh, far: FloatArray) -> dict[str, Any]:
    """Return a mesh as a machine's YAML has it: turned about x, y, then z, in the far frame."""
    pose = np.linalg.inv(far) @ look.pose
    turn = pose[:3, :3]
    pitch = math.asin(max(-1.0, min(1.0, -turn[2, 0])))
    if abs(turn[2, 0]) < 1.0 - NEARLY:
        roll, yaw = math.atan2(turn[2, 1], turn[2, 2]), math.atan2(turn[1, 0], turn[0, 0])
    else:  # upright: roll and yaw are one turn
        roll, yaw = math.atan2(-turn[1, 2], turn[1, 1]), 0.0
    return {
        "file": look.file,
        "scale": look.scale,
        "position": pose[:3, 3].tolist(),
        "turn_deg": [math.degrees(roll), math.degrees(pitch), math.degrees(yaw)],
    }


def together(masses: Sequence[Mass]) -> Mass:
    """Return several masses as one, by the parallel axis theorem."""
    mass = sum(each.mass for each in masses)
    if mass <= 0.0:
        return Mass(0.0, masses[0].centre, np.zeros((3, 3)))
    centre = sum((each.mass * each.centre for each in masses), np.zeros(3)) / mass
    inertia = np.zeros((3, 3))
    for each in masses:
        off = each.centre - centre
        inertia += each.inertia + each.mass * (off @ off * np.eye(3) - np.outer(off, off))
    return Mass(mass, centre, inertia)
