"""Estimates of one channel that are computed once a second."""

import math
from abc import abstractmethod
from typing import Generic, TypeVar

from labcrane import Estimate, FloatArray
from labcrane.core import Estimated, SignalStream
from labcrane_estimates.settings import HeartSettings, SkinSettings
from labcrane_estimates.window import Window

SettingsT = TypeVar("SettingsT", bound=HeartSettings | SkinSettings)


class OnceASecond(Estimate, Generic[SettingsT]):
    """Gives the values of the newest window, once a second; NaN where samples are missing."""

    def __init__(self, settings: SettingsT) -> None:
        self._settings = settings

    def begin(self, stream: SignalStream) -> None:
        self._window = Window(stream, [self._settings.channel], self._settings.window_s)
        self._rate_hz = stream.rate_hz
        self._newest: Estimated | None = None

    def update(self, times: FloatArray, samples: FloatArray) -> Estimated | None:
        if not self._window.take(times, samples):
            return None
        if self._newest is None or not 0.0 <= times[-1] - self._newest.time < 1.0:
            names = self._settings.values
            values = self._values() if self._window.whole else (math.nan,) * len(names)
            self._newest = Estimated(float(times[-1]), float(self._window.times[0]), values)
        return self._newest

    @abstractmethod
    def _values(self) -> tuple[float, ...]:
        """Return what the whole window gives."""
