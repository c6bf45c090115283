"""The share of the gaze in a rectangle."""

import math

import numpy as np

from labcrane import Estimate, FloatArray
from labcrane.core import Estimated, SignalStream
from labcrane_estimates.settings import GazeRegionSettings
from labcrane_estimates.window import Window


class GazeRegion(Estimate):
    """Gives the share of the window's samples, of those with a gaze; NaN where none has one."""

    def __init__(self, settings: GazeRegionSettings) -> None:
        self._settings = settings

    def begin(self, stream: SignalStream) -> None:
        self._window = Window(stream, self._settings.channels, self._settings.window_s)

    def update(self, times: FloatArray, samples: FloatArray) -> Estimated | None:
        if not self._window.take(times, samples):
            return None
        gaze = self._window.samples
        seen = gaze[np.isfinite(gaze).all(axis=1)]
        low, high = np.array([self._settings.between_x, self._settings.between_y]).T
        inside = ((seen >= low) & (seen <= high)).all(axis=1)
        share = float(inside.mean()) if len(seen) else math.nan
        return Estimated(float(times[-1]), float(self._window.times[0]), (share,))
