"""Sliding windows over samples in chunks, lasting faults, and monitors made of both."""

from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import numpy.typing as npt

from labcrane import FloatArray, SignalMonitor
from labcrane.core import SignalFault, SignalStream
from labcrane_signals.channels import labels

WIDTH_S = 1.0
HOP_S = 0.5
"""Interval between windows: a fault that lasts for six of them is reported within 4.5 s."""

BoolArray = npt.NDArray[np.bool_]


class Windows:
    """Cuts a signal into windows of one second, half of it new.

    Parameters
    ----------
    rate_hz
        Samples per second, above 0.
    channels
        How many there are.
    """

    def __init__(self, rate_hz: float, channels: int) -> None:
        self.hop = max(round(rate_hz * HOP_S), 1)
        self.width = max(round(rate_hz * WIDTH_S), 2)
        self._rest = np.empty((0, channels))

    def feed(self, samples: FloatArray) -> Iterator[FloatArray]:
        """Yield each window that is complete now, shape ``(width, n_channels)``, oldest first."""
        self._rest = np.concatenate([self._rest, samples])
        begin = 0
        while begin + self.width <= len(self._rest):
            yield self._rest[begin : begin + self.width]
            begin += self.hop
        if begin:
            self._rest = self._rest[begin:]


class Streak:
    """Whether a fault has lasted for several windows, for each channel.

    A good window cancels bad windows, so that an intermittent fault is reported late.

    Parameters
    ----------
    need
        Number of bad windows after which a fault is reported.
    channels
        Number of channels.
    back
        Bad windows that a good one cancels: few for faults that come and go with the signal.
    """

    def __init__(self, need: int, channels: int, back: int = 2) -> None:
        self._need, self._back = need, back
        self._count = np.zeros(channels, dtype=np.int64)
        self.raised: BoolArray = np.zeros(channels, dtype=np.bool_)

    def add(self, bad: BoolArray) -> BoolArray:
        """Add the next verdicts, shape ``(n_channels,)``; return the faults reported now."""
        count = np.where(bad, self._count + 1, self._count - self._back)
        self._count = np.clip(count, 0, self._need + 2)
        self.raised = (self._count >= self._need) | (self.raised & (self._count > 0))
        return self.raised


class WindowedMonitor(SignalMonitor):
    """Judge some channels of a stream window by window; a finding holds until the next one."""

    def watch(self, stream: SignalStream, columns: Sequence[int], need: Mapping[str, int]) -> None:
        """Begin with a stream.

        Parameters
        ----------
        columns
            Its channels that are judged, in order.
        need
            Bad windows until each kind of fault counts.
        """
        self._columns = list(columns)
        self._labels = labels(stream, self._columns)
        self._windows = Windows(stream.rate_hz, len(self._columns))
        self._streaks = {kind: Streak(most, len(self._columns)) for kind, most in need.items()}
        self._faults: list[SignalFault] = []

    def look(self, times: FloatArray, samples: FloatArray) -> Sequence[SignalFault]:
        del times
        for window in self._windows.feed(samples[:, self._columns]):
            self._faults = self._judge(window)
        return self._faults

    @abstractmethod
    def _judge(self, window: FloatArray) -> list[SignalFault]:
        """Return what is wrong after one more window, shape ``(width, n_columns)``."""
