"""The scheme of a control panel: each axis is a valve's signal."""

import numpy as np
import numpy.typing as npt

from labcrane import Controller, FloatArray, Machine, ProtocolError, Run, Signal
from labcrane.core import Layout
from labcrane.machines import Arm
from labcrane_dmd.arm.settings import ValveSettings
from labcrane_dmd.model.interpolation import FULL
from labcrane_dmd.model.model import Model

DAMPING_M = 0.05
"""Beside metre-long links: keeps a practised hand calm where the arm is stretched out."""

HALVINGS = 12
"""Of the way from the dead band to full flow: to a sixteenth of a step."""

STILL = 1e-3
"""Joint speed in rad/s below which a hand does not push through the dead band."""

END_RAD = 0.01
"""A practised hand stops a joint this far from its end."""


class Valve(Controller):
    """Signals in steps of 0.4 % of full flow, -250 to 250, as auxiliary valve commands have them.

    ``command`` is the signal as a share of the machine's joint speed, for machines that know no
    valves.
    """

    def __init__(self, settings: ValveSettings, machine: Machine) -> None:
        for joint in settings.map:
            if joint not in machine.names:
                raise ProtocolError(
                    f"map names joint {joint!r}; the machine has {', '.join(machine.names)}"
                )
        self.signals = (
            Signal("command", "rad/s", machine.names),
            Signal("valve.signal", "1", machine.names),
        )
        self._wanted = list(settings.axes(machine).values())
        self._machine = machine
        self._arm = Arm(machine)
        self._speeds = np.array(machine.speeds)
        self._model = model = _model(settings)
        self._segments = (
            [
                model[joint.name] if joint.name in model else model.proportional(joint)
                for joint in machine.joints
            ]
            if model
            else []
        )
        self._out = np.zeros(2 * len(machine.names))

    def open(self, run: Run) -> None:
        self._axes = [_find(run.axes, name) for name in self._wanted]
        if len({index for index, _ in self._axes}) < len(self._axes):
            raise ProtocolError(
                f"two joints have the same axis, of {', '.join(self._wanted)}; give each its own"
            )
        self._n_axes = run.axes.size
        self._angle = run.state.find("joint.angle")

    def command(self, axes: FloatArray, state: FloatArray) -> FloatArray:
        joints = len(self._axes)
        for joint, (index, sign) in enumerate(self._axes):
            self._out[joints + joint] = float(round(sign * axes.item(index) * FULL))
        self._out[:joints] = self._out[joints:] / FULL * self._speeds
        return self._out

    def inverse(self, velocity: FloatArray, state: FloatArray) -> FloatArray:
        angles = state[self._angle].tolist()
        bearing = self._arm.bearing(angles)
        cos, sin = np.cos(bearing), np.sin(bearing)
        x, y, z = velocity.tolist()
        columns = np.array(self._arm.planar_jacobian(angles)).T
        radius = -columns[1, 0]
        slew = (cos * y - sin * x) * radius / (radius**2 + DAMPING_M**2)
        wanted = np.array([cos * x + sin * y, z])
        free, pitch = np.ones(columns.shape[1]), np.zeros(columns.shape[1])
        for _ in free:  # each pass leaves out the joints that would be driven against an end
            weighted = columns * free
            damped = weighted @ columns.T + DAMPING_M**2 * np.eye(2)
            pitch = weighted.T @ np.linalg.solve(damped, wanted)
            blocked = self._blocked(angles, pitch)
            if not (blocked & (free > 0.0)).any():
                break
            free[blocked] = 0.0
        speeds = [float(slew), *(free * pitch).tolist()]
        shares = [self._share(joint, speed, angles[joint]) for joint, speed in enumerate(speeds)]
        most = max(1.0, *map(abs, shares))
        axes = np.zeros(self._n_axes)
        for (index, sign), share in zip(self._axes, shares, strict=True):
            axes[index] = sign * share / most
        return axes

    def _blocked(self, angles: list[float], pitch: FloatArray) -> npt.NDArray[np.bool_]:
        """Return which pitch joints would be driven against the end of their range."""
        low, high = np.array(self._machine.limits[1:]).T
        at = np.array(angles[1:])
        against: npt.NDArray[np.bool_] = ((at < low + END_RAD) & (pitch < 0.0)) | (
            (at > high - END_RAD) & (pitch > 0.0)
        )
        return against

    def _share(self, joint: int, speed: float, angle: float) -> float:
        """Return the share of full signal for a joint speed; beyond 1 when that is not enough."""
        full = self._machine.speeds[joint]
        if self._model is None:
            return speed / full
        if abs(speed) < STILL:
            return 0.0
        segment, sign = self._segments[joint], 1.0 if speed > 0.0 else -1.0
        low, high = segment.direction(speed).dead_band, FULL
        fastest = abs(segment.speed(sign * FULL, angle))
        if fastest <= abs(speed):
            return speed / fastest if fastest else sign
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            if abs(segment.speed(sign * middle, angle)) < abs(speed):
                low = middle
            else:
                high = middle
        return sign * high / FULL


def _model(settings: ValveSettings) -> Model | None:
    if settings.model is None:
        return None
    from labcrane_dmd.model.model_file import load  # noqa: PLC0415 - only with a model

    return load(settings.model)


def _find(axes: Layout, name: str) -> tuple[int, float]:
    return axes.index(name.removeprefix("-")), -1.0 if name.startswith("-") else 1.0
