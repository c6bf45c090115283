"""Our own clock where something turned it: other clocks are followed on one that nothing turned.

A slew of ours is in every other computer's offset, as a knee that probes show seconds late. The
recorder logged our clock beside one that is left alone, several times a second: on that one nothing
is bent, and what was found is put back on ours, exactly.
"""

from dataclasses import dataclass, replace

import numpy as np

from labcrane.streams.sync.raw import LOCAL, OFFSET, REMOTE, RTT, RawStream
from labcrane.types import FloatArray

TURNED = 2e-5
"""A change of rate below this is followed by probes as any crystal's, in seconds per second."""

SLEW = 1e-4
WINDOW_S = 4.0
SAME_S = 5e-5
LONG_S = 5.0


@dataclass(frozen=True, slots=True)
class OwnClock:
    """Readings of our clock and of one that nothing turns, in seconds, shape ``(n,)`` each."""

    time: FloatArray
    raw: FloatArray

    @classmethod
    def of(cls, raw: RawStream) -> "OwnClock | None":
        """Return what was logged with a stream; None where it cannot be used.

        No use: nothing was logged, our clock was not turned, or the stream's stamps are of it too.
        """
        log = raw.own
        if len(log) < 3 or _is_ours(raw.probes):  # noqa: PLR2004
            return None
        log = log[np.argsort(log[:, 0], kind="stable")]
        log = log[np.r_[True, (np.diff(log[:, 0]) > 0.0) & (np.diff(log[:, 1]) > 0.0)]]
        if len(log) < 3:  # noqa: PLR2004
            return None
        clock = cls(log[:, 0], log[:, 1] - log[0, 1] + log[0, 0])
        rates = clock._rates()[1]
        return clock if np.ptp(rates) > TURNED else None

    def straight(self, times: FloatArray) -> FloatArray:
        """Return times of our clock on the one that nothing turned."""
        return _through(self.time, self.raw, times)

    def ours(self, times: FloatArray) -> FloatArray:
        """Return times of the one that nothing turned on our clock."""
        return _through(self.raw, self.time, times)

    def doubt(self, times: FloatArray) -> FloatArray:
        """Return how far :meth:`ours` may be off: a knee may lie anywhere between two readings."""
        rate = np.diff(self.time) / np.diff(self.raw)
        change = np.abs(np.diff(rate, prepend=rate[0], append=rate[-1]))
        k = np.clip(np.searchsorted(self.time, times) - 1, 0, len(rate) - 1)
        length = np.diff(self.time)[k]
        inside = (times >= self.time[0]) & (times <= self.time[-1])
        beyond = np.maximum(self.time[0] - times, times - self.time[-1])
        bend = np.maximum(change[k], change[k + 1])
        return np.where(
            inside, bend * length / 4.0, np.ptp(self._rates()[1]) * np.maximum(beyond, 0)
        )

    def slews(self) -> int:
        """Return how often its rate was changed at once."""
        _, rates = self._rates()
        change = np.abs(rates[2:] - rates[:-2]) if len(rates) > 2 else np.empty(0)  # noqa: PLR2004
        above = np.flatnonzero(change > SLEW)
        return int(np.count_nonzero(np.diff(above, prepend=-10) > 2)) if len(above) else 0  # noqa: PLR2004

    def straightened(self, raw: RawStream) -> RawStream:
        """Return a stream as it would have been received by the clock that nothing turned."""
        probes, arrivals, resets = raw.probes.copy(), raw.arrivals.copy(), raw.resets.copy()
        probes[:, OFFSET] = self.straight(probes[:, REMOTE] + probes[:, OFFSET]) - probes[:, REMOTE]
        probes[:, LOCAL] = self.straight(probes[:, LOCAL])
        arrivals[:, 1] = self.straight(arrivals[:, 1])
        resets[:, 0] = self.straight(resets[:, 0])
        return replace(raw, probes=probes, arrivals=arrivals, resets=resets)

    def _rates(self) -> tuple[FloatArray, FloatArray]:
        """Return when stretches of some seconds begin, and our clock's rate beyond the other's."""
        count = max(int((self.time[-1] - self.time[0]) / WINDOW_S), 1)
        edges = np.unique(
            np.searchsorted(self.time, np.linspace(self.time[0], self.time[-1], count + 1))
        )
        rates = np.diff(self.time[edges]) / np.diff(self.raw[edges]) - 1.0
        return self.time[edges[:-1]], rates


def _through(x: FloatArray, y: FloatArray, at: FloatArray) -> FloatArray:
    """Interpolate; beyond the ends the last rate, over some seconds, goes on."""
    result = np.interp(at, x, y)
    for end, beyond in ((0, at < x[0]), (-1, at > x[-1])):
        near = np.abs(x - x[end]) <= LONG_S
        rate = np.ptp(y[near]) / np.ptp(x[near])
        result[beyond] = y[end] + (at[beyond] - x[end]) * rate
    return result


def _is_ours(probes: FloatArray) -> bool:
    """Whether probes are of a program on our computer, whose clock is ours."""
    if not len(probes):
        return True
    beyond = np.abs(probes[:, OFFSET]) - probes[:, RTT] / 2.0
    return bool(np.quantile(beyond, 0.9) < SAME_S)
