"""Heart rate and RMSSD, from the R peaks of an ECG."""

import math

import numpy as np
from scipy.signal import butter, find_peaks, sosfiltfilt

from labcrane import Estimate, FloatArray
from labcrane.core import Estimated, SignalStream
from labcrane_estimates.settings import HeartSettings
from labcrane_estimates.window import Window

BAND_HZ = (5.0, 20.0)
"""Where the energy of a QRS complex is (Pan and Tompkins 1985: 5 to 15 Hz)."""

REFRACTORY_S = 0.3
FEWEST = 3
"""Peaks from which both values can be computed."""


class Heart(Estimate):
    """Gives both of the newest window, once a second; NaN where there are too few beats."""

    def __init__(self, settings: HeartSettings) -> None:
        self._settings = settings

    def begin(self, stream: SignalStream) -> None:
        self._window = Window(stream, [self._settings.channel], self._settings.window_s)
        self._rate_hz = stream.rate_hz
        self._newest: Estimated | None = None

    def update(self, times: FloatArray, samples: FloatArray) -> Estimated | None:
        if not self._window.take(times, samples):
            return None
        if self._newest is None or times[-1] - self._newest.time >= 1.0:
            values = self._values() if self._window.whole else (math.nan, math.nan)
            self._newest = Estimated(float(times[-1]), float(self._window.times[0]), values)
        return self._newest

    def _values(self) -> tuple[float, float]:
        band = butter(2, BAND_HZ, "bandpass", fs=self._rate_hz, output="sos")
        energy = sosfiltfilt(band, self._window.samples[:, 0]) ** 2
        peaks, _ = find_peaks(
            energy, height=0.3 * np.quantile(energy, 0.99), distance=REFRACTORY_S * self._rate_hz
        )
        if len(peaks) < FEWEST:
            return math.nan, math.nan
        beats = np.diff(self._window.times[peaks])
        return 60.0 / float(beats.mean()), 1e3 * float(np.sqrt((np.diff(beats) ** 2).mean()))
