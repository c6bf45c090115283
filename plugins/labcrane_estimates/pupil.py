"""The size of the pupil against its baseline."""

import math

import numpy as np

from labcrane import Estimate, FloatArray
from labcrane.core import Estimated, SignalStream
from labcrane_estimates.settings import PupilSettings
from labcrane_estimates.window import Window


class Pupil(Estimate):
    """Gives the mean of the window over the median of the baseline, minus 1; NaN in a blink."""

    def __init__(self, settings: PupilSettings) -> None:
        self._settings = settings

    def begin(self, stream: SignalStream) -> None:
        self._window = Window(stream, [self._settings.channel], self._settings.baseline_s)

    def update(self, times: FloatArray, samples: FloatArray) -> Estimated | None:
        if not self._window.take(times, samples):
            return None
        size, when = self._window.samples[:, 0], self._window.times
        seen = np.isfinite(size) & (size > 0.0)
        now = size[seen & (when > times[-1] - self._settings.window_s)]
        change = float(now.mean() / np.median(size[seen])) - 1.0 if len(now) else math.nan
        return Estimated(float(times[-1]), float(when[0]), (change,))
