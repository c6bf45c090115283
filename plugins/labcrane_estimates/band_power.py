"""The ratio of two band powers, by Welch's method."""

import math

from scipy.signal import welch

from labcrane import Estimate, FloatArray
from labcrane.core import Estimated, SignalStream
from labcrane_estimates.settings import BandPowerSettings
from labcrane_estimates.window import Window


class BandPower(Estimate):
    """Gives the ratio of the newest window; NaN where samples are missing or not numbers."""

    def __init__(self, settings: BandPowerSettings) -> None:
        self._settings = settings

    def begin(self, stream: SignalStream) -> None:
        settings = self._settings
        channels = (*settings.channels, *settings.per_channels)
        self._window = Window(stream, channels, settings.window_s)
        self._rate_hz = stream.rate_hz

    def update(self, times: FloatArray, samples: FloatArray) -> Estimated | None:
        if not self._window.take(times, samples):
            return None
        ratio = self._ratio() if self._window.whole else math.nan
        return Estimated(float(times[-1]), float(self._window.times[0]), (ratio,))

    def _ratio(self) -> float:
        settings = self._settings
        frequencies, powers = welch(
            self._window.samples, self._rate_hz, nperseg=round(self._rate_hz), axis=0
        )
        split = len(settings.channels)
        parts = ((powers[:, :split], settings.band_hz), (powers[:, split:], settings.per_band_hz))
        above, below = (
            float(power[(frequencies >= low) & (frequencies < high)].mean())
            for power, (low, high) in parts
        )
        return above / below if below > 0.0 else math.nan
