"""The last seconds of some channels of a stream."""

from collections.abc import Sequence

import numpy as np

from labcrane import FloatArray, StreamError
from labcrane.core import SignalStream


class Window:
    """Keeps the samples of the last seconds.

    Attributes
    ----------
    times, samples
        What is kept, shapes ``(n,)`` and ``(n, n_channels)``.

    Raises
    ------
    StreamError
        The stream has no such channel, or no rate.
    """

    def __init__(self, stream: SignalStream, channels: Sequence[str], seconds: float) -> None:
        labels = [each.label for each in stream.channels]
        if missing := [name for name in channels if name not in labels]:
            raise StreamError(
                f"stream {stream.name!r} has no channel {', '.join(missing)}; it has "
                f"{', '.join(labels) or 'no labels'}"
            )
        if not stream.rate_hz > 0.0:
            raise StreamError(f"stream {stream.name!r} has no rate; give a regular stream")
        self._columns = [labels.index(name) for name in channels]
        self._seconds, self._rate_hz = seconds, stream.rate_hz
        self.times, self.samples = np.empty(0), np.empty((0, len(channels)))
        self._began = np.nan

    def take(self, times: FloatArray, samples: FloatArray) -> bool:
        """Take the next samples; return whether the window has been filled.

        It begins again where times go back: the source's clock was set.
        """
        if np.isnan(self._began) or (len(self.times) and times[0] < self.times[-1]):
            self.times, self.samples = self.times[:0], self.samples[:0]
            self._began = float(times[0])
        since = times[-1] - self._seconds
        self.times = np.concatenate([self.times, times])
        self.samples = np.concatenate([self.samples, samples[:, self._columns]])
        keep = self.times > since
        self.times, self.samples = self.times[keep], self.samples[keep]
        return bool(self._began <= since + 1.0 / self._rate_hz)

    @property
    def whole(self) -> bool:
        """Whether at least 95 % of its samples have come, all of them numbers."""
        enough = len(self.times) >= 0.95 * self._seconds * self._rate_hz
        return bool(enough and np.isfinite(self.samples).all())
