"""Poses a crane can be set to."""

import math
from collections.abc import Sequence

from labcrane.errors import ProtocolError
from labcrane.machines.machine import Machine

ROUNDING = 1e-9
"""How far in rad a pose may lie outside the limits: degrees do not convert exactly."""


def check_pose(machine: Machine, pose: Sequence[float]) -> list[float]:
    """Return ``pose`` in rad as plain floats, or raise :class:`ProtocolError`."""
    angles = [float(angle) for angle in pose]
    if len(angles) != len(machine.joints):
        raise ProtocolError(
            f"a pose of {len(angles)} angles was asked for; this machine has "
            f"{len(machine.joints)} joints ({', '.join(machine.names)})"
        )
    for joint, angle in zip(machine.joints, angles, strict=True):
        lowest, highest = joint.limits
        if not lowest - ROUNDING <= angle <= highest + ROUNDING:
            raise ProtocolError(
                f"a pose with {joint.name} at {math.degrees(angle):.2f} degrees was asked for; "
                f"it goes from {joint.range_deg[0]:g} to {joint.range_deg[1]:g}"
            )
    return angles
