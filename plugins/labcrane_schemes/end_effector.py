"""End-effector-velocity control: each axis moves the tip along one direction."""

from collections.abc import Mapping, Sequence

import numpy as np

from labcrane import Controller, FloatArray, Machine, Run
from labcrane.core import Kernel, Sphere, Value
from labcrane_schemes.attainable import attainable
from labcrane_schemes.axis_map import find_axes
from labcrane_schemes.law import SPEED, block, command, hands, kernel_of, put_sticks
from labcrane_schemes.settings import DIRECTIONS, EndEffectorSettings
from labcrane_schemes.signals import rest, scheme_signals


class EndEffector(Controller):
    """Moves the tip in a straight line wherever the sticks point.

    Parameters
    ----------
    share
        Of the speed that the joints allow, where the settings name none.
    """

    def __init__(self, settings: EndEffectorSettings, machine: Machine, share: float = 1.0) -> None:
        self.signals = scheme_signals(machine)
        self._settings = settings
        self._share = share
        self._machine = machine
        self.law = block(machine, settings, machine.speeds, settings.frame)
        self._out = rest(machine)
        self._rest = rest(machine)
        self._made = self._out.tolist()

    def open(self, run: Run) -> None:
        directions = DIRECTIONS[self._settings.frame]
        axes = find_axes(run.axes, directions, self._settings.map)
        put_sticks(self.law, axes, (1.0,) * len(axes))
        self._n_axes = run.axes.size
        self._angle = run.state.find("joint.angle")
        self.law[SPEED] = self._full_speed(run.places)

    def _full_speed(self, places: Sequence[Sphere]) -> float:
        """Return the tip speed in m/s of a full push of one axis, to the mm/s."""
        given = self._settings.speed_m_s
        return given or round(self._share * attainable(self._machine, self.law, places), 3)

    def metadata(self) -> Mapping[str, Value]:
        return {"speed_m_s": self.law[SPEED]}

    def attainable(self, places: Sequence[Sphere]) -> Mapping[str, float]:
        speed = attainable(self._machine, self.law, places, self._full_speed(places))
        return {"end_effector": speed}

    def command(self, axes: FloatArray, state: FloatArray) -> FloatArray:
        command(self.law, 0, axes.tolist(), state[self._angle].tolist(), self._made)
        self._out[:] = self._made
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
