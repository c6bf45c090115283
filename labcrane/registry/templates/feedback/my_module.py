"""my_part: a device that presents the session: a lamp, a sound, a display."""

import math

import numpy as np
from pydantic import PositiveFloat

from labcrane import Feedback, FloatArray, Frame, Offer, Run, Settings, Signal, hookimpl, offer
from labcrane.core import Within

labcrane_api = 1


class MyPartSettings(Settings):
    """Settings of my_part; a protocol writes them next to ``use``."""

    far: PositiveFloat = 4.0
    """Distance of tip and target, in metres, from which on it is dark."""

    def reveals(self) -> tuple[Within, ...]:
        # Facts about the task's error that it shows: `labcrane check` asks who gets it. () for none
        return (Within("how far the tip is from the target", self.far),)


class MyPart(Feedback):
    """A lamp that brightens as the tip comes closer. It runs in a process of its own."""

    # What present returns; recorded with every frame presented.
    signals = (Signal("brightness", "1"),)

    def __init__(self, settings: MyPartSettings) -> None:
        self._settings = settings

    def open(self, run: Run) -> None:
        # Connect here, and raise labcrane.DeviceError when nobody answers.
        self._tip = run.state.find("tip.position")
        self._target = run.task.find("target.position")

    def present(self, frame: Frame) -> FloatArray:
        distance = float(np.linalg.norm(frame.task[self._target] - frame.state[self._tip]))
        if math.isnan(distance):  # between trials there is no target
            self.idle()
            return np.zeros(1)
        brightness = max(0.0, 1.0 - distance / self._settings.far)
        self._shine(brightness)
        return np.array([brightness])

    def idle(self) -> None:
        self._shine(0.0)

    def _shine(self, brightness: float) -> None:
        """Tell your device here; you may wait for it, the session does not."""

    def close(self) -> None:
        """Disconnect here; called even when open failed."""


@hookimpl
def labcrane_feedback() -> list[Offer[Feedback]]:
    return [offer("my_part", MyPartSettings, MyPart)]
