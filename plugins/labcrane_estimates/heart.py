"""Heart rate and RMSSD, from the R peaks of an ECG."""

import math

import numpy as np
from scipy.signal import butter, find_peaks, sosfiltfilt

from labcrane_estimates.once_a_second import OnceASecond
from labcrane_estimates.settings import HeartSettings

BAND_HZ = (5.0, 20.0)
"""Where the energy of a QRS complex is (Pan and Tompkins 1985: 5 to 15 Hz)."""

REFRACTORY_S = 0.3
FEWEST = 3
"""Peaks from which both values can be computed."""


class Heart(OnceASecond[HeartSettings]):
    """Gives both of the newest window; NaN where there are too few beats."""

    highest_hz = BAND_HZ[1]

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
