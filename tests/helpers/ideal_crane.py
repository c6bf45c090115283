"""A crane whose joints turn exactly as commanded, integrated without error."""

import math
from collections.abc import Sequence

import numpy as np

from labcrane import FloatArray, Machine
from labcrane.machines import Arm
from labcrane.testing import RATE_HZ


class IdealCrane:
    """Joint speeds held over a tick, so that the angles are exact; the state of a bundled crane."""

    def __init__(self, machine: Machine, pose: Sequence[float]) -> None:
        self.arm = Arm(machine)
        self.joints = len(machine.names)
        self._set([float(angle) for angle in pose], [0.0] * self.joints)

    def step(self, command: FloatArray) -> FloatArray:
        speeds = command[: self.joints].tolist()
        angles = self.state[: self.joints].tolist()
        moved = [angle + speed / RATE_HZ for angle, speed in zip(angles, speeds, strict=True)]
        self._set(moved, speeds)
        return self.state

    @property
    def angles(self) -> FloatArray:
        return self.state[: self.joints]

    @property
    def tip(self) -> FloatArray:
        return self.state[-6:-3]

    def _set(self, angles: Sequence[float], speeds: Sequence[float]) -> None:
        bearing, (radius, _) = self.arm.bearing(angles), self.arm.plane(angles)
        columns = self.arm.planar_jacobian(angles)
        out = sum(r * speed for (r, _), speed in zip(columns, speeds[1:], strict=True))
        up = sum(z * speed for (_, z), speed in zip(columns, speeds[1:], strict=True))
        cos, sin, side = math.cos(bearing), math.sin(bearing), radius * speeds[0]
        velocity = (cos * out - sin * side, sin * out + cos * side, up)
        self.state = np.array([*angles, *speeds, *self.arm.tip(angles), *velocity])
