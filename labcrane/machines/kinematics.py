"""Kinematics: where the tip is, and how the joints must move to move it.

``dh_matrix`` and ``frames`` are the reference: the product of standard Denavit-Hartenberg
matrices (facts of the crane study; the printed matrix has two misprints, see
``docs/decisions/0002-dh-matrix.md``). ``Arm`` is the same in scalars for the loop: a slewing base
and a planar chain, 26 times cheaper than the numpy product.
"""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from labcrane.machines.machine import Machine

if TYPE_CHECKING:  # whether a point can be reached is known without loading numpy
    from labcrane.types import FloatArray


def dh_matrix(a: float, alpha: float, d: float, theta: float) -> "FloatArray":
    """Return the standard DH transform, shape ``(4, 4)``: lengths in m, angles in rad."""
    import numpy as np  # noqa: PLC0415

    ct, st, ca, sa = math.cos(theta), math.sin(theta), math.cos(alpha), math.sin(alpha)
    return np.array(
        [
            [ct, -st * ca, st * sa, a * ct],
            [st, ct * ca, -ct * sa, a * st],
            [0.0, sa, ca, d],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def link_frames(machine: Machine, angles: Sequence[float]) -> "FloatArray":
    """Return the base frame's and every joint's frame, shape ``(n_joints + 1, 4, 4)``.

    ``angles`` are joint angles in rad. Frame ``i`` sits at the far end of link ``i``; the last
    one is the tip.
    """
    import numpy as np  # noqa: PLC0415

    pose = np.eye(4)
    pose[0, 3] = machine.base_x
    poses = [pose]
    for joint, angle in zip(machine.joints, angles, strict=True):
        pose = pose @ dh_matrix(joint.a, joint.alpha, joint.d, angle + joint.offset)
        poses.append(pose)
    return np.stack(poses)


def jacobian(machine: Machine, angles: Sequence[float]) -> "FloatArray":
    """Return the tip velocity per joint speed, shape ``(3, n_joints)``, in m/rad."""
    import numpy as np  # noqa: PLC0415

    poses = link_frames(machine, angles)
    tip = poses[-1, :3, 3]
    return np.column_stack([np.cross(pose[:3, 2], tip - pose[:3, 3]) for pose in poses[:-1]])


class Arm:
    """Scalar kinematics of one machine.

    Angles are in rad, positive pitch is down. The planar coordinates are the radius from the
    slew axis and the height.
    """

    def __init__(self, machine: Machine) -> None:
        slew, *chain = machine.joints
        self._base_x = machine.base_x
        self._foot = slew.a
        self._height = slew.d
        self._slew_offset = slew.offset
        self._links = tuple((number, each.a, each.offset) for number, each in enumerate(chain, 1))

    def plane(self, angles: Sequence[float]) -> tuple[float, float]:
        """Return the tip's radius and height in m."""
        radius, height, pitch = self._foot, self._height, 0.0
        for joint, length, offset in self._links:
            pitch += angles[joint] + offset
            radius += length * math.cos(pitch)
            height -= length * math.sin(pitch)
        return radius, height

    def tip(self, angles: Sequence[float]) -> tuple[float, float, float]:
        """Return the tip's x, y and z in the base frame, in m."""
        radius, height = self.plane(angles)
        slew = angles[0] + self._slew_offset
        return self._base_x + radius * math.cos(slew), radius * math.sin(slew), height

    def bearing(self, angles: Sequence[float]) -> float:
        """Return the direction in which the arm points from the slew axis, in rad."""
        return angles[0] + self._slew_offset

    def planar_jacobian(self, angles: Sequence[float]) -> Sequence[tuple[float, float]]:
        """Return radius and height per joint speed in m/rad, one pair for every pitch joint."""
        pitch, links = 0.0, []
        for joint, length, offset in self._links:
            pitch += angles[joint] + offset
            links.append((length, pitch))
        radius, drop, columns = 0.0, 0.0, []
        for length, pitch in reversed(links):  # a joint moves all links behind it
            radius += length * math.cos(pitch)
            drop += length * math.sin(pitch)
            columns.append((-drop, -radius))
        columns.reverse()
        return columns
