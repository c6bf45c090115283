"""State array of a crane: joints, then the tip that they put somewhere."""

import math
from collections.abc import Sequence
from functools import partial
from struct import Struct

import numpy as np

from labcrane.machines.kinematics import Arm
from labcrane.machines.machine import Machine
from labcrane.types import FloatArray


class CraneState(Arm):
    """An arm, and one array that its state is filled into on every tick.

    The tip's motion is scalar: that costs less than asking an engine for it, and
    is the tip of the joint angles in the same array to the last digit.

    Attributes
    ----------
    values
        The state, shape ``(2 * n_joints + 6,)``; of a crane with drives ``(4 * n_joints + 6,)``.
    """

    def __init__(self, machine: Machine, *, drives: bool = False) -> None:
        super().__init__(machine)
        joints = len(machine.joints)
        self._idle = (0.0,) * joints if drives else ()
        self.values: FloatArray = np.zeros(2 * joints + 6 + 2 * len(self._idle))
        # Packing numbers into an array costs half of assigning them.
        self._put = partial(Struct(f"{len(self.values)}d").pack_into, self.values.data, 0)

    def fill(
        self,
        angles: Sequence[float],
        speeds: Sequence[float],
        loads: Sequence[float] | None = None,
        saturated: Sequence[float] | None = None,
    ) -> FloatArray:
        """Return the state with joints at ``angles`` in rad, moving at ``speeds`` in rad/s.

        Of a crane with drives, ``loads`` are their torques as shares of the joints' efforts, and
        ``saturated`` where a drive gives all it has, 1 or -1 by its direction; 0 by default.
        """
        pitch, turning = 0.0, 0.0
        radius, height, outward, upward = self._foot, self._height, 0.0, 0.0
        for joint, length, offset in self._links:
            pitch += angles[joint] + offset
            turning += speeds[joint]
            forward, down = length * math.cos(pitch), length * math.sin(pitch)
            radius += forward
            height -= down
            outward -= down * turning
            upward -= forward * turning
        bearing = angles[0] + self._slew_offset
        ahead, left = math.cos(bearing), math.sin(bearing)
        sideways = radius * speeds[0]
        self._put(
            *angles,
            *speeds,
            self._base_x + radius * ahead,
            radius * left,
            height,
            outward * ahead - sideways * left,
            outward * left + sideways * ahead,
            upward,
            *(loads or self._idle),
            *(saturated or self._idle),
        )
        return self.values
