"""my_part: values estimated from a stream while a session runs."""

from typing import ClassVar

import numpy as np
from pydantic import PositiveFloat

from labcrane import Estimate, FloatArray, Offer, hookimpl, offer
from labcrane.core import Estimated, EstimateSettings, SignalStream

labcrane_api = 1


class MyPartSettings(EstimateSettings):
    """Settings of my_part; a protocol writes them next to ``use``."""

    values: ClassVar = ("mean",)

    window_s: PositiveFloat = 1.0
    """Time over which the mean is taken, in seconds."""


class MyPart(Estimate):
    """The mean of a stream's first channel over the last second."""

    def __init__(self, settings: MyPartSettings) -> None:
        self._settings = settings

    def begin(self, stream: SignalStream) -> None:
        self._times, self._signal = np.empty(0), np.empty(0)

    def update(self, times: FloatArray, samples: FloatArray) -> Estimated | None:
        self._times = np.concatenate([self._times, times])
        self._signal = np.concatenate([self._signal, samples[:, 0]])
        since = times[-1] - self._settings.window_s
        if self._times[0] > since:
            return None  # the window is not full yet
        keep = self._times >= since
        self._times, self._signal = self._times[keep], self._signal[keep]
        return Estimated(float(times[-1]), float(since), (float(self._signal.mean()),))


@hookimpl
def labcrane_estimates() -> list[Offer[Estimate]]:
    return [offer("my_part", MyPartSettings, MyPart)]
