"""The rate of skin conductance responses, from an EDA."""

from scipy.signal import butter, detrend, find_peaks, sosfiltfilt

from labcrane_estimates.once_a_second import OnceASecond
from labcrane_estimates.settings import SkinSettings

HIGHEST_HZ = 1.0
"""Responses rise within 1 to 3 s (Boucsein 2012): what is faster is noise."""


class Skin(OnceASecond[SkinSettings]):
    """Counts the peaks that rise and fall by an amplitude: a response counts once it has fallen.

    A drift that is a straight line over the window is removed first.
    """

    highest_hz = HIGHEST_HZ

    def _values(self) -> tuple[float]:
        low = butter(2, HIGHEST_HZ, fs=self._rate_hz, output="sos")
        level = sosfiltfilt(low, detrend(self._window.samples[:, 0]))
        peaks, _ = find_peaks(level, prominence=self._settings.smallest)
        return (60.0 * len(peaks) / self._settings.window_s,)
