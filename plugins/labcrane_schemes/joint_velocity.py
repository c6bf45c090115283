"""Joint-velocity control: each axis turns one joint."""

from collections.abc import Mapping, Sequence
from functools import partial
from struct import Struct

import numpy as np

from labcrane import Controller, FloatArray, Machine, Run
from labcrane.core import Kernel, Sphere
from labcrane_schemes.attainable import attainable
from labcrane_schemes.axis_map import Axis, check_joints, find_axes
from labcrane_schemes.law import kernel_numbers, law
from labcrane_schemes.resolved_rate import NOTHING, ResolvedRate
from labcrane_schemes.settings import JointVelocitySettings
from labcrane_schemes.shaping import Shaping
from labcrane_schemes.signals import rest, scheme_signals
from labcrane_schemes.soft_stops import soft_stops


class JointVelocity(Controller):
    """Turns each joint at a share of its speed."""

    def __init__(self, settings: JointVelocitySettings, machine: Machine) -> None:
        check_joints(machine.names, settings.map)
        self.signals = scheme_signals(machine)
        self._settings = settings
        self._machine = machine
        self._names = machine.names
        self._full = tuple(settings.speed * speed for speed in machine.speeds)
        self._shaping = Shaping(settings.dead_zone, settings.expo)
        self._stops = soft_stops(machine, settings.soft_stop_deg)
        self._rate = ResolvedRate(machine, self._stops, self._full)
        self._out = rest(machine)
        self._rest = rest(machine)
        # Packing numbers into an array costs half of assigning them.
        self._put = partial(Struct(f"{len(self._out)}d").pack_into, self._out.data, 0)
        self._sticks: tuple[Axis, ...] = ()  # with the joint's speed that a full push asks for

    def open(self, run: Run) -> None:
        axes = find_axes(run.axes, self._names, self._settings.map)
        self._sticks = tuple(
            (axis, sign * full) for (axis, sign), full in zip(axes, self._full, strict=True)
        )
        self._hands = np.zeros(run.axes.size)
        self._angle = run.state.find("joint.angle")

    def attainable(self, places: Sequence[Sphere]) -> Mapping[str, float]:
        return {"joint_velocity": attainable(self._machine, self._rate, places)}

    def command(self, axes: FloatArray, state: FloatArray) -> FloatArray:
        pushes, angles = axes.tolist(), state[self._angle].tolist()
        shape = self._shaping.shape
        speeds = [full * shape(pushes[axis]) for axis, full in self._sticks]
        limited = self._stops.factors(angles, speeds)
        if limited is not self._stops.nothing_lost:
            speeds = [speed * left for speed, left in zip(speeds, limited, strict=True)]
        self._put(*speeds, 1.0, *limited)
        return self._out

    def idle(self) -> FloatArray:
        return self._rest.copy()

    def inverse(self, velocity: FloatArray, state: FloatArray) -> FloatArray:
        angles = state[self._angle].tolist()
        speeds, scale, factors = self._rate.solve_base(angles, *velocity.tolist())
        hands, unshape = self._hands, self._shaping.unshape
        for (axis, full), speed, left in zip(self._sticks, speeds, factors, strict=True):
            moves = abs(speed) > NOTHING and left > 0.0
            hands[axis] = unshape(scale * speed / (full * left)) if moves else 0.0
        return hands

    @property
    def law(self) -> FloatArray:
        """What its compiled kernel works with."""
        return law(self._machine, self._sticks, self._shaping, self._stops, self._rate, self._full)

    def kernel(self) -> Kernel:
        from labcrane_schemes.compiled import command, hands  # noqa: PLC0415 - loads numba

        return Kernel(command, kernel_numbers(self.law), changing=0, inverse=hands)
