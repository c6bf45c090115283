"""State array of a crane: joints, then the tip that they put somewhere."""

from collections.abc import Sequence
from functools import partial
from struct import Struct

import numpy as np

from labcrane.core.cranes.law import tip_motion
from labcrane.machines.machine import Machine
from labcrane.types import FloatArray


class CraneState:
    """One array that the state of a crane is filled into on every tick.

    The tip's motion is scalar: that costs less than asking an engine for it, and
    is the tip of the joint angles in the same array to the last digit.

    Attributes
    ----------
    values
        The state, shape ``(2 * n_joints + 6,)``; of a crane with drives ``(4 * n_joints + 6,)``.
    """

    def __init__(self, machine: Machine, *, drives: bool = False) -> None:
        joints = len(machine.joints)
        slew, *chain = machine.joints
        self._lengths = tuple(each.a for each in chain)
        self._offsets = tuple(each.offset for each in chain)
        self._foot, self._base_x, self._height = slew.a, machine.base_x, slew.d
        self._slew_offset = slew.offset
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
        self._put(
            *angles,
            *speeds,
            *tip_motion(
                angles, speeds, self._lengths, self._offsets,
                self._foot, self._base_x, self._height, angles[0] + self._slew_offset,
            ),
            *(loads or self._idle),
            *(saturated or self._idle),
        )  # fmt: skip
        return self.values
