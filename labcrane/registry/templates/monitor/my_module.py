"""my_part: a monitor of other programs' signals."""

from collections.abc import Sequence

import numpy as np
from pydantic import PositiveFloat

from labcrane import FloatArray, Offer, Settings, SignalMonitor, hookimpl, offer
from labcrane.core import SignalFault, SignalStream

labcrane_api = 1


class MyPartSettings(Settings):
    """Settings of my_part; a protocol writes them next to ``use``."""

    largest: PositiveFloat = 100.0
    """Largest value that is believed, in the unit of the stream."""

    patience_s: PositiveFloat = 2.0
    """How long a channel is beyond it until that is reported, in seconds."""


class MyPart(SignalMonitor):
    """Reports channels of streams of type ``Temperature`` that stay beyond a limit."""

    def __init__(self, settings: MyPartSettings) -> None:
        self._settings = settings

    def knows(self, stream: SignalStream) -> bool:
        return stream.type == "Temperature" and stream.rate_hz > 0

    def begin(self, stream: SignalStream) -> None:
        self._labels = [channel.label for channel in stream.channels]
        self._need = self._settings.patience_s * stream.rate_hz
        self._beyond = np.zeros(len(self._labels))  # samples in a row, per channel

    def look(self, times: FloatArray, samples: FloatArray) -> Sequence[SignalFault]:
        for beyond in ~(np.abs(samples) <= self._settings.largest):  # NaN as well
            self._beyond = np.where(beyond, self._beyond + 1, 0)
        message = f"is beyond {self._settings.largest:g}: check the sensor"
        return [
            SignalFault(label, "too large", message)
            for label, count in zip(self._labels, self._beyond, strict=True)
            if count >= self._need
        ]


@hookimpl
def labcrane_monitors() -> list[Offer[SignalMonitor]]:
    return [offer("my_part", MyPartSettings, MyPart)]
