"""End-effector-velocity control: each axis moves the tip along one direction."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from labcrane import Controller, FloatArray, Machine, ProtocolError, Run
from labcrane.core import Kernel, Sphere, Value
from labcrane.machines import Arm
from labcrane_schemes.attainable import attainable
from labcrane_schemes.axis_map import Axis, find_axes
from labcrane_schemes.law import kernel_numbers, law
from labcrane_schemes.resolved_rate import ResolvedRate
from labcrane_schemes.settings import DIRECTIONS, EndEffectorSettings
from labcrane_schemes.shaping import Shaping
from labcrane_schemes.signals import rest, scheme_signals
from labcrane_schemes.soft_stops import soft_stops

FEWEST_TO_HOLD_PITCH = 4
"""Joints with which the tip can keep its pitch and still go anywhere."""


class EndEffector(Controller):
    """Moves the tip in a straight line wherever the sticks point.

    Parameters
    ----------
    share
        Of the speed that the joints allow, where the settings name none.
    """

    def __init__(self, settings: EndEffectorSettings, machine: Machine, share: float = 1.0) -> None:
        if settings.redundancy == "hold_pitch" and len(machine.joints) < FEWEST_TO_HOLD_PITCH:
            raise ProtocolError(
                f"redundancy 'hold_pitch' needs {FEWEST_TO_HOLD_PITCH} joints, but the machine has "
                f"{len(machine.joints)}; use 'minimum_norm'"
            )
        self.signals = scheme_signals(machine)
        self._settings = settings
        self._share = share
        self._speed = settings.speed_m_s or math.nan  # known when the targets are
        self._base = settings.frame == "base"
        self._machine = machine
        self._arm = Arm(machine)
        self._shaping = Shaping(settings.dead_zone, settings.expo)
        self._stops = soft_stops(machine, settings.soft_stop_deg)
        self._rate = ResolvedRate(
            machine,
            self._stops,
            machine.speeds,
            settings.redundancy,
            settings.damping,
            settings.threshold_m,
        )
        self._out = rest(machine)
        self._rest = rest(machine)
        self._axes: tuple[Axis, ...] = ()

    def open(self, run: Run) -> None:
        directions = DIRECTIONS[self._settings.frame]
        self._axes = find_axes(run.axes, directions, self._settings.map)
        self._n_axes = run.axes.size
        self._angle = run.state.find("joint.angle")
        self._speed = self._full_speed(run.places)

    def _full_speed(self, places: Sequence[Sphere]) -> float:
        """Return the tip speed in m/s of a full push of one axis, to the mm/s."""
        given = self._settings.speed_m_s
        return given or round(self._share * attainable(self._machine, self._rate, places), 3)

    def metadata(self) -> Mapping[str, Value]:
        return {"speed_m_s": self._speed}

    def attainable(self, places: Sequence[Sphere]) -> Mapping[str, float]:
        speed = attainable(self._machine, self._rate, places, self._full_speed(places))
        return {"end_effector": speed}

    def command(self, axes: FloatArray, state: FloatArray) -> FloatArray:
        pushes, angles, out = axes.tolist(), state[self._angle].tolist(), self._out
        shape, full_speed = self._shaping.shape, self._speed
        velocity = [sign * full_speed * shape(pushes[axis]) for axis, sign in self._axes]
        solve = self._rate.solve_base if self._base else self._rate.solve
        speeds, scale, factors = solve(angles, *velocity)
        joints = len(speeds)
        out[joints] = scale
        for joint, speed in enumerate(speeds):
            out[joint] = scale * speed
            out[joints + 1 + joint] = factors[joint]
        return out

    def idle(self) -> FloatArray:
        return self._rest.copy()

    def inverse(self, velocity: FloatArray, state: FloatArray) -> FloatArray:
        x, y, z = velocity.tolist()
        if not self._base:
            bearing = self._arm.bearing(state[self._angle].tolist())
            cos, sin = math.cos(bearing), math.sin(bearing)
            x, y = cos * x + sin * y, cos * y - sin * x
        most = max(abs(x), abs(y), abs(z), self._speed)
        axes = np.zeros(self._n_axes)
        for (axis, sign), part in zip(self._axes, (x, y, z), strict=True):
            axes[axis] = sign * self._shaping.unshape(part / most)
        return axes

    @property
    def law(self) -> FloatArray:
        """What its compiled kernel works with."""
        full = self._machine.speeds
        tip = (self._speed, self._base)
        return law(self._machine, self._axes, self._shaping, self._stops, self._rate, full, tip)

    def kernel(self) -> Kernel:
        from labcrane_schemes.compiled import command, hands  # noqa: PLC0415 - loads numba

        return Kernel(command, kernel_numbers(self.law), changing=0, inverse=hands)
