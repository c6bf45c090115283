"""Joint-velocity control: each axis turns one joint."""

import numpy as np

from labcrane import Controller, FloatArray, Machine, Run
from labcrane_schemes.axis_map import Axis, check_joints, find_axes
from labcrane_schemes.log import rest, scheme_signals
from labcrane_schemes.resolved_rate import NOTHING, ResolvedRate
from labcrane_schemes.settings import JointVelocitySettings
from labcrane_schemes.shaping import Shaping
from labcrane_schemes.soft_stops import soft_stops


class JointVelocity(Controller):
    """Turns each joint at a share of its speed."""

    def __init__(self, settings: JointVelocitySettings, machine: Machine) -> None:
        check_joints(machine.names, settings.map)
        self.signals = scheme_signals(machine)
        self._settings = settings
        self._names = machine.names
        self._full = tuple(settings.speed * speed for speed in machine.speeds)
        self._shaping = Shaping(settings.dead_zone, settings.expo)
        self._stops = soft_stops(machine, settings.soft_stop_deg)
        self._rate = ResolvedRate(machine, self._stops)
        self._out = rest(machine)
        self._rest = rest(machine)
        self._axes: tuple[Axis, ...] = ()

    def open(self, run: Run) -> None:
        self._axes = find_axes(run.axes, self._names, self._settings.map)
        self._n_axes = run.axes.size
        self._angle = run.state.find("joint.angle")

    def command(self, axes: FloatArray, state: FloatArray) -> FloatArray:
        pushes, angles, out = axes.tolist(), state[self._angle].tolist(), self._out
        shape, factor = self._shaping.shape, self._stops.factor
        speeds, limited = [], []
        free = self._stops.free(angles)
        for joint, (axis, sign) in enumerate(self._axes):
            speed = sign * shape(pushes[axis]) * self._full[joint]
            left = 1.0 if free else factor(joint, angles[joint], speed)
            speeds.append(speed * left)
            limited.append(left)
        out[:] = (*speeds, 1.0, *limited)
        return out

    def rest(self) -> FloatArray:
        return self._rest.copy()

    def steer(self, velocity: FloatArray, state: FloatArray) -> FloatArray:
        angles = state[self._angle].tolist()
        speeds = self._rate.solve_base(angles, *velocity.tolist())
        scale, factors = self._rate.fit(angles, speeds, self._full)
        axes, unshape = [0.0] * self._n_axes, self._shaping.unshape
        for (axis, sign), speed, full, left in zip(
            self._axes, speeds, self._full, factors, strict=True
        ):
            if abs(speed) > NOTHING and left > 0.0:
                axes[axis] = sign * unshape(scale * speed / (full * left))
        return np.array(axes)
