"""The joint speeds that move the tip as asked: damped least squares in scalars.

The slew turns the arm's plane and the pitch joints move within it, so the three directions
radial, tangential and vertical fall apart into one number for the slew and a two-row system for
the pitch joints.
"""

import math
from collections.abc import Sequence
from typing import Literal

from labcrane import Machine
from labcrane.machines import Arm
from labcrane_schemes.soft_stops import SoftStops

Redundancy = Literal["minimum_norm", "hold_pitch"]
NOTHING = 1e-12
"""Joint speed in rad/s that is rounding, not motion; a joint at its limit may have it."""

Column = tuple[float, float]
"""Radius and height per joint speed, in m/rad."""

Motion = tuple[Sequence[float], float, Sequence[float]]
"""Joint speeds in rad/s, the scale that brings them all within their limits, and the share of each
that the soft stops leave."""


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
    full
        The largest joint speeds in rad/s.
    redundancy
        ``minimum_norm`` or ``hold_pitch``.
    damping, threshold
        Largest damping, and the singular value at which it begins, in m.
    """

    def __init__(
        self,
        machine: Machine,
        stops: SoftStops,
        full: Sequence[float],
        redundancy: Redundancy = "minimum_norm",
        damping: float = 0.2,
        threshold: float = 0.5,
    ) -> None:
        self._arm = Arm(machine)
        self._foot = machine.joints[0].a
        self._stops = stops
        self._full = tuple(full)
        self._hold_pitch = redundancy == "hold_pitch"
        self._damping2 = damping * damping
        self._threshold2 = threshold * threshold

    @property
    def numbers(self) -> tuple[float, ...]:
        """What a compiled kernel solves with."""
        return (float(self._hold_pitch), self._damping2, self._threshold2)

    def solve_base(self, angles: Sequence[float], x: float, y: float, z: float) -> Motion:
        """Return the joints' motion for a tip velocity in the base frame, in m/s."""
        bearing = self._arm.bearing(angles)
        cos, sin = math.cos(bearing), math.sin(bearing)
        return self.solve(angles, cos * x + sin * y, cos * y - sin * x, z)

    def solve(
        self, angles: Sequence[float], radial: float, tangential: float, vertical: float
    ) -> Motion:
        """Return the joints' motion for a tip velocity along the arm, in m/s."""
        columns = self._arm.planar_jacobian(angles)
        radius = self._foot - columns[0][1]  # the first pitch axis may be before the slew axis
        radius2 = radius * radius
        slew = tangential * radius / (radius2 + self._damp(radius2))
        if self._hold_pitch:
            columns = _without_turning(columns)
        pitch = self._pitch(columns, radial, vertical)
        if self._stops.free(angles):
            return self._fit([slew, *pitch], self._stops.nothing_lost)
        # A joint less would leave too few to keep the pitch and the tip on its path.
        if not self._hold_pitch:
            pitch = self._relieved(angles, columns, pitch, radial, vertical)
        speeds = [slew, *pitch]
        return self._fit(speeds, self._stops.factors(angles, speeds))

    def _fit(self, speeds: Sequence[float], factors: Sequence[float]) -> Motion:
        """Bring all joints within their speeds by one scale, which keeps the tip's direction.

        Cutting single joints would bend its path.
        """
        scale = 1.0
        for speed, full, factor in zip(speeds, self._full, factors, strict=True):
            size, most = abs(speed), full * factor
            if size * scale > most and size > NOTHING:
                scale = most / size
        return speeds, scale, factors

    def _relieved(
        self,
        angles: Sequence[float],
        columns: Sequence[Column],
        pitch: Sequence[float],
        radial: float,
        vertical: float,
    ) -> Sequence[float]:
        """Return the pitch joints' speeds with those weighted down that run into a soft stop."""
        weights = [1.0] * len(columns)
        for _ in columns:  # each pass takes load off at least one more joint
            relieved = False
            for number, speed in enumerate(pitch):
                factor = self._stops.factor(number + 1, angles[number + 1], speed)
                if factor < weights[number]:
                    weights[number] = factor
                    relieved = True
            if not relieved:
                break
            roots = [math.sqrt(weight) for weight in weights]
            scaled = [(root * r, root * z) for root, (r, z) in zip(roots, columns, strict=True)]
            shares = self._pitch(scaled, radial, vertical)
            pitch = [root * share for root, share in zip(roots, shares, strict=True)]
        return pitch

    def _pitch(self, columns: Sequence[Column], radial: float, vertical: float) -> Sequence[float]:
        """Return ``Jᵀ (J Jᵀ + λ² I)⁻¹ v``, the pitch joints' speeds in rad/s."""
        rr = rz = zz = 0.0
        for r, z in columns:
            rr += r * r
            rz += r * z
            zz += z * z
        threshold2 = self._threshold2
        # This test for an eigenvalue below the threshold needs no square root; it rarely holds.
        if rr < threshold2 or (rr - threshold2) * (zz - threshold2) <= rz * rz:
            damp = self._damp(_smallest(rr, rz, zz))
            rr += damp
            zz += damp
        det = rr * zz - rz * rz
        y_r = (zz * radial - rz * vertical) / det
        y_z = (rr * vertical - rz * radial) / det
        return [r * y_r + z * y_z for r, z in columns]

    def _damp(self, singular2: float) -> float:
        """Return the square of the damping, in m², for the square of a singular value."""
        if singular2 >= self._threshold2:
            return 0.0
        return self._damping2 * (1.0 - singular2 / self._threshold2)


def _without_turning(columns: Sequence[Column]) -> list[Column]:
    """Return ``J (I - 1 1ᵀ/n)``: what is left has speeds that add up to zero."""
    # Added one by one: sum() rounds otherwise since Python 3.12.
    sum_r = sum_z = 0.0
    for r, z in columns:
        sum_r += r
        sum_z += z
    mean_r, mean_z = sum_r / len(columns), sum_z / len(columns)
    return [(r - mean_r, z - mean_z) for r, z in columns]


def _smallest(rr: float, rz: float, zz: float) -> float:
    """Return the smaller eigenvalue of a symmetric matrix that has none below 0."""
    # A root of squares, not hypot: that rounds otherwise since Python 3.12.
    apart, twice = rr - zz, 2.0 * rz
    largest = 0.5 * (rr + zz + math.sqrt(apart * apart + twice * twice))
    return max(rr * zz - rz * rz, 0.0) / largest if largest > 0.0 else 0.0
