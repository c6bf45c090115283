"""my_part: a device that the operator moves."""

import math

import numpy as np
from pydantic import PositiveFloat

from labcrane import (
    FloatArray,
    Frame,
    InputDevice,
    Offer,
    Run,
    Settings,
    Signal,
    Tick,
    hookimpl,
    offer,
)

labcrane_api = 1


class MyPartSettings(Settings):
    """Settings of my_part; a protocol writes them next to ``use``."""

    period_s: PositiveFloat = 4.0
    """Period of the wave that replaces a hand, in seconds."""


class MyPart(InputDevice):
    """Two sticks. A wave replaces the device until you read a real one."""

    signals = (Signal("left", "1", ("x", "y")), Signal("right", "1", ("x", "y")))

    def __init__(self, settings: MyPartSettings) -> None:
        self._settings = settings

    def open(self, run: Run) -> None:
        # Connect here, and raise labcrane.DeviceError when nobody answers.
        self._rate_hz = run.rate_hz

    def read(self, tick: Tick, seen: Frame) -> FloatArray:
        # Never wait here. Say in self.fault why the device cannot be trusted, None when it can.
        seconds = tick.number / self._rate_hz
        wave = math.sin(2.0 * math.pi * seconds / self._settings.period_s)
        return np.array([wave, 0.0, 0.0, 0.0])

    def close(self) -> None:
        """Disconnect here; called even when open failed."""


@hookimpl
def labcrane_inputs() -> list[Offer[InputDevice]]:
    return [offer("my_part", MyPartSettings, MyPart)]
