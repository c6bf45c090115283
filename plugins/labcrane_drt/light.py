"""The light as a cue."""

from collections.abc import Sequence

import numpy as np

from labcrane import Cue, FloatArray, Frame, Run, Signal
from labcrane.core import Shape, Sphere
from labcrane_drt.settings import LightSettings


class Light(Cue):
    """Shows a ball while a stimulus is on."""

    signals = (Signal("on", "1"),)

    def __init__(self, settings: LightSettings) -> None:
        colour = (*settings.colour, 1.0)
        self._ball = Sphere("light", settings.at, settings.size, colour)
        self._stimulus = settings.stimulus

    def open(self, run: Run) -> None:
        self._at = run.task.index(self._stimulus)

    def draw(self, frame: Frame) -> Sequence[Shape]:
        return (self._ball,) if frame.task[self._at] > 0.0 else ()

    def values(self, frame: Frame) -> FloatArray:
        return np.array([float(frame.task[self._at] > 0.0)])
