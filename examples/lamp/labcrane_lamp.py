"""A lamp that brightens, and a motor that shakes the seat, as the tip comes closer.

The device exchanges lines of ASCII at 115200 baud. It answers ``?`` with its name, and accepts
``L 0`` to ``L 255`` (light) and ``M 0`` to ``M 255`` (motor). It switches off when it receives
nothing for half a second, so that the motor stops if the program crashes.
"""

import math
from collections.abc import Mapping

import numpy as np
from pydantic import Field, PositiveFloat

from labcrane import (
    DeviceError,
    Feedback,
    FloatArray,
    Frame,
    Offer,
    Run,
    Settings,
    Signal,
    hookimpl,
    offer,
)
from labcrane.core import Value, Within

labcrane_api = 1

FULL = 255
ANSWER_S = 2.0


class LampSettings(Settings):
    """Where the lamp is connected, and how it follows the distance."""

    port: str
    """Serial port: ``/dev/ttyUSB0``, or ``COM3``."""

    far: PositiveFloat = 4.0
    """Distance between tip and target, in metres, beyond which the lamp is dark."""

    shake_below: float = Field(default=0.5, ge=0.0)
    """Distance in metres below which the motor runs; it runs faster as the tip gets closer."""

    def reveals(self) -> tuple[Within, ...]:
        return (Within("how far the tip is from the target", max(self.far, self.shake_below)),)


class Lamp(Feedback):
    """Set light and motor from the distance alone."""

    signals = (Signal("light", "1"), Signal("motor", "1"))

    def __init__(self, settings: LampSettings) -> None:
        self._settings = settings
        self._line = None
        self._name = ""

    def open(self, run: Run) -> None:
        import serial

        self._tip = run.state.find("tip.position")
        self._target = run.task.find("target.position")
        try:
            self._line = serial.Serial(self._settings.port, 115200, timeout=ANSWER_S)
            self._line.write(b"?\n")
            self._name = self._line.readline().decode("ascii", "replace").strip()
        except serial.SerialException as error:
            raise DeviceError(
                f"no lamp on {self._settings.port}: {error}; check the cable and the key port: in "
                "the protocol"
            ) from error
        if not self._name.startswith("lamp"):
            raise DeviceError(
                f"the device on {self._settings.port} is not a lamp: it answered {self._name!r}; "
                "check port: in the protocol"
            )

    def metadata(self) -> Mapping[str, Value]:
        return {"device": self._name}

    def present(self, frame: Frame) -> FloatArray:
        distance = float(np.linalg.norm(frame.task[self._target] - frame.state[self._tip]))
        if math.isnan(distance):  # between trials there is no target
            self.idle()
            return np.zeros(2)
        light = max(0.0, 1.0 - distance / self._settings.far)
        near = self._settings.shake_below
        motor = max(0.0, 1.0 - distance / near) if near else 0.0
        self._send(light, motor)
        return np.array([light, motor])

    def idle(self) -> None:
        self._send(0.0, 0.0)

    def close(self) -> None:
        if self._line is not None:
            self._send(0.0, 0.0)
            self._line.close()
            self._line = None

    def _send(self, light: float, motor: float) -> None:
        if self._line is not None:
            self._line.write(b"L %d\nM %d\n" % (round(FULL * light), round(FULL * motor)))


@hookimpl
def labcrane_feedback() -> list[Offer[Feedback]]:
    return [offer("lamp", LampSettings, Lamp)]
