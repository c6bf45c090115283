"""Hydraulic cylinders and hoses of a crane whose links have no meshes: for the eye alone."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from labcrane import FloatArray, Machine
from labcrane.machines import Body
from labcrane_view.scene.mesh import Mesh, cone, joined

HOSE = 0.028
"""Radius of a hose, in metres."""


@dataclass(frozen=True, slots=True)
class Ram:
    """A cylinder that holds a link against the one before it.

    Attributes
    ----------
    name
        The joint that it turns.
    frames
        DH frames of the link before and of the link behind the joint.
    foot, eye
        Where it is fixed to each of them, in that frame, in metres.
    radius, barrel
        Of the barrel, in metres, and its length.
    """

    name: str
    frames: tuple[int, int]
    foot: tuple[float, float, float]
    eye: tuple[float, float, float]
    radius: float
    barrel: float

    def ends(self, poses: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return foot and eye in the base frame; ``poses`` as of ``link_frames``."""
        one, other = (
            poses[frame][:3, :3] @ np.array(point) + poses[frame][:3, 3]
            for frame, point in zip(self.frames, (self.foot, self.eye), strict=True)
        )
        return one, other


def rams(machine: Machine, bodies: Sequence[Body]) -> Iterator[Ram]:
    """Yield a cylinder for every joint that pitches between two links without meshes of their own.

    A link lies along x behind its joint, and y is down; the column reaches down along y.
    """
    plain = {body.frame for body in bodies if body.mesh is None and not body.moves}
    slew, *chain = machine.joints
    for number, joint in enumerate(chain, start=1):
        if not {number, number + 1} <= plain or joint.a == 0.0:
            continue
        before = machine.joints[number - 1]
        if number == 1:  # from the column's foot to the underside of the boom
            foot = (0.62 * slew.thickness, 0.55 * slew.d, 0.0)
            eye = (-0.70 * joint.a, 0.62 * joint.thickness, 0.0)
        else:  # over the back of the link before, to a horn at the joint
            foot = (-0.62 * before.a, -0.85 * before.thickness, 0.0)
            eye = (-0.88 * joint.a, -0.95 * joint.thickness, 0.0)
        radius = 0.28 * joint.thickness
        yield Ram(joint.name, (number, number + 1), foot, eye, radius, 0.42 * joint.a)


def hoses(body: Body) -> Mesh | None:
    """Return a hose along each side of a link, in its frame; None unless it is a beam along x."""
    long, high, wide = body.size
    if long < 2.0 * max(high, wide):
        return None
    start, end = body.centre[0] - 0.46 * long, body.centre[0] + 0.40 * long
    lines = []
    for side in (-1.0, 1.0):
        y, z = -0.1 * high, side * (0.5 * wide + HOSE)
        lines.append(cone((start, y, z), (end, y, z), (HOSE, HOSE), 6))
    return joined(*lines)
