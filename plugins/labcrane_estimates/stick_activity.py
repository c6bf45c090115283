"""How fast, and for how much of the time, the sticks are moved."""

import math

import numpy as np

from labcrane import Estimate, FloatArray
from labcrane.core import Estimated, SignalStream
from labcrane_estimates.settings import StickActivitySettings
from labcrane_estimates.window import Window


class StickActivity(Estimate):
    """Gives both of the newest window; NaN where samples are missing or not numbers."""

    def __init__(self, settings: StickActivitySettings) -> None:
        self._settings = settings

    def begin(self, stream: SignalStream) -> None:
        self._window = Window(stream, self._settings.channels, self._settings.window_s)
        self._rate_hz = stream.rate_hz

    def update(self, times: FloatArray, samples: FloatArray) -> Estimated | None:
        if not self._window.take(times, samples):
            return None
        values = self._values() if self._window.whole else (math.nan, math.nan)
        return Estimated(float(times[-1]), float(self._window.times[0]), values)

    def _values(self) -> tuple[float, float]:
        lag = max(1, round(self._settings.step_s * self._rate_hz))
        axes = self._window.samples
        speeds = (axes[lag:] - axes[:-lag]) * (self._rate_hz / lag)
        moving = (np.abs(speeds) > self._settings.still).any(axis=1)
        return float(np.sqrt((speeds**2).sum(axis=1).mean())), float(moving.mean())
