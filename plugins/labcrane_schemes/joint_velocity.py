"""Joint-velocity control: each axis turns one joint."""

from collections.abc import Mapping, Sequence
from functools import partial
from struct import Struct

import numpy as np

from labcrane import Controller, FloatArray, Machine, Run
from labcrane.core import Kernel, Sphere
from labcrane_schemes.attainable import attainable
from labcrane_schemes.axis_map import find_axes
from labcrane_schemes.law import block, command, hands, kernel_of, put_sticks
from labcrane_schemes.settings import JointVelocitySettings
from labcrane_schemes.signals import rest, scheme_signals


class JointVelocity(Controller):
    """Turns each joint at a share of its speed."""

    def __init__(self, settings: JointVelocitySettings, machine: Machine) -> None:
        self.signals = scheme_signals(machine)
        self._settings = settings
        self._machine = machine
        self._names = machine.names
        self._full = tuple(settings.speed * speed for speed in machine.speeds)
        self.law = block(machine, settings, self._full)
        self._out = rest(machine)
        self._rest = rest(machine)
        self._made = self._out.tolist()
        # Packing numbers into an array costs half of assigning them.
        self._put = partial(Struct(f"{len(self._out)}d").pack_into, self._out.data, 0)

    def open(self, run: Run) -> None:
        axes = find_axes(run.axes, self._names, self._settings.map)
        put_sticks(self.law, axes, self._full)
        self._n_axes = run.axes.size
        self._angle = run.state.find("joint.angle")

    def attainable(self, places: Sequence[Sphere]) -> Mapping[str, float]:
        return {"joint_velocity": attainable(self._machine, self.law, places)}

    def command(self, axes: FloatArray, state: FloatArray) -> FloatArray:
        command(self.law, 0, axes.tolist(), state[self._angle].tolist(), self._made)
        self._put(*self._made)
        return self._out

    def idle(self) -> FloatArray:
        return self._rest.copy()

    def inverse(self, velocity: FloatArray, state: FloatArray) -> FloatArray:
        axes = [0.0] * self._n_axes
        x, y, z = velocity.tolist()
        hands(self.law, 0, state[self._angle].tolist(), x, y, z, axes)
        return np.array(axes)

    def kernel(self) -> Kernel:
        return kernel_of(self.law)
