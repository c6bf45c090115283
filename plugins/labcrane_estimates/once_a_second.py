"""Estimates of one channel that are computed once a second."""

import math
from abc import abstractmethod
from typing import Generic, TypeVar

from labcrane import Estimate, FloatArray, StreamError
from labcrane.core import Estimated, SignalStream
from labcrane_estimates.settings import HeartSettings, SkinSettings
from labcrane_estimates.window import Window

SettingsT = TypeVar("SettingsT", bound=HeartSettings | SkinSettings)


class OnceASecond(Estimate, Generic[SettingsT]):
    """Gives the values of the newest window, once a second; NaN where samples are missing.

    Attributes
    ----------
    highest_hz
        Up to which frequency the signal is needed.
    """

    highest_hz: float

    def __init__(self, settings: SettingsT) -> None:
        self._settings = settings

    def begin(self, stream: SignalStream) -> None:
        self._window = Window(stream, [self._settings.channel], self._settings.window_s)
        if not stream.rate_hz > 2.0 * self.highest_hz:
            raise StreamError(
                f"stream {stream.name!r} has {stream.rate_hz:g} Hz, and its signal is needed up to "
                f"{self.highest_hz:g} Hz; give a stream of more than {2.0 * self.highest_hz:g} Hz"
            )
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
