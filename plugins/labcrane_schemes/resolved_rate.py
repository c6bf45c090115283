"""The joint speeds that move the tip as asked: damped least squares in scalars.

The slew turns the arm's plane and the pitch joints move within it, so the three directions
radial, tangential and vertical fall apart into one number for the slew and a two-row system for
the pitch joints.
"""

import math
from collections.abc import Sequence
from typing import Literal

from labcrane import Arm, Machine
from labcrane_schemes.soft_stops import SoftStops

Redundancy = Literal["minimum_norm", "hold_pitch"]
NOTHING = 1e-12
"""Joint speed in rad/s that is rounding, not motion; a joint at its limit may have it."""


class ResolvedRate:
    """Inverse differential kinematics of one machine.

    Damping grows from 0 at the threshold to its largest value at a singularity (Nakamura and
    Hanafusa 1986). Joints near a limit are weighted down and the rest take over; what remains is
    slowed as a whole, so that the tip keeps its direction.

    Parameters
    ----------
    machine
        Whose joints.
    stops
        What is left of a joint's speed near its limits.
    redundancy
        ``minimum_norm`` or ``hold_pitch``.
    damping, threshold
        Largest damping, and the singular value at which it begins, in m.
    """

    def __init__(
        self,
        machine: Machine,
        stops: SoftStops,
        redundancy: Redundancy = "minimum_norm",
        damping: float = 0.2,
        threshold: float = 0.5,
    ) -> None:
        self._arm = Arm(machine)
        self._stops = stops
        self._hold_pitch = redundancy == "hold_pitch"
        self._damping2 = damping * damping
        self._threshold2 = threshold * threshold

    def solve_base(
        self, angles: Sequence[float], x: float, y: float, z: float
    ) -> tuple[float, ...]:
        """Return the joint speeds in rad/s for a tip velocity in the base frame, in m/s."""
        bearing = self._arm.bearing(angles)
        cos, sin = math.cos(bearing), math.sin(bearing)
        return self.solve(angles, cos * x + sin * y, cos * y - sin * x, z)

    def solve(
        self, angles: Sequence[float], radial: float, tangential: float, vertical: float
    ) -> tuple[float, ...]:
        """Return the joint speeds in rad/s for a tip velocity along the arm, in m/s."""
        columns = self._arm.planar_jacobian(angles)
        radius = -columns[0][1]  # the shoulder sits on the slew axis
        radius2 = radius * radius
        slew = tangential * radius / (radius2 + self._damp(radius2))
        weights = [1.0] * len(columns)
        pitch = self._pitch(columns, weights, radial, vertical)
        # A joint less would leave too few to keep the pitch and the tip on its path.
        if self._hold_pitch or self._stops.free(angles):
            return slew, *pitch
        for _ in columns:  # each pass takes load off at least one more joint
            if not self._relieve(angles, pitch, weights):
                break
            pitch = self._pitch(columns, weights, radial, vertical)
        return slew, *pitch

    def fit(
        self, angles: Sequence[float], speeds: Sequence[float], full: Sequence[float]
    ) -> tuple[float, list[float]]:
        """Return the scale that brings all joints within their speeds, and the soft stops.

        ``full`` are the largest joint speeds in rad/s. One scale for all joints keeps the tip's
        direction; cutting single joints would bend its path.
        """
        scale, factors = 1.0, [1.0] * len(speeds)
        free = self._stops.free(angles)
        for joint, speed in enumerate(speeds):
            if not free:
                factors[joint] = self._stops.factor(joint, angles[joint], speed)
            size, most = abs(speed), full[joint] * factors[joint]
            if size > NOTHING and size * scale > most:
                scale = most / size
        return scale, factors

    def _relieve(
        self, angles: Sequence[float], pitch: Sequence[float], weights: list[float]
    ) -> bool:
        """Weight down the joints that run into their soft stops; say whether any was."""
        relieved = False
        for number, speed in enumerate(pitch):
            factor = self._stops.factor(number + 1, angles[number + 1], speed)
            if factor < weights[number]:
                weights[number] = factor
                relieved = True
        return relieved

    def _pitch(
        self,
        columns: Sequence[tuple[float, float]],
        weights: Sequence[float],
        radial: float,
        vertical: float,
    ) -> list[float]:
        """Return ``W Jᵀ (J W Jᵀ + λ² I)⁻¹ v``, the pitch joints' speeds in rad/s."""
        if self._hold_pitch:  # J (I - 1 1ᵀ/n): what is left has speeds that add up to zero
            mean_r = sum(r for r, _ in columns) / len(columns)
            mean_z = sum(z for _, z in columns) / len(columns)
            columns = [(r - mean_r, z - mean_z) for r, z in columns]
        rr = rz = zz = 0.0
        for (r, z), weight in zip(columns, weights, strict=True):
            rr += weight * r * r
            rz += weight * r * z
            zz += weight * z * z
        largest2 = 0.5 * (rr + zz + math.hypot(rr - zz, 2.0 * rz))
        smallest2 = max(rr * zz - rz * rz, 0.0) / largest2 if largest2 > 0.0 else 0.0
        damp = self._damp(smallest2)
        rr += damp
        zz += damp
        det = rr * zz - rz * rz
        y_r = (zz * radial - rz * vertical) / det
        y_z = (rr * vertical - rz * radial) / det
        return [
            weight * (r * y_r + z * y_z) for (r, z), weight in zip(columns, weights, strict=True)
        ]

    def _damp(self, singular2: float) -> float:
        """Return the square of the damping, in m², for the square of a singular value."""
        if singular2 >= self._threshold2:
            return 0.0
        return self._damping2 * (1.0 - singular2 / self._threshold2)
