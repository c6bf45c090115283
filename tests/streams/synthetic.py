"""Sources with clocks whose truth is a closed form."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from labcrane.streams.sync.raw import RawStream


@dataclass(frozen=True)
class SourceClock:
    """Reads ``t + offset + ppm (t - 100) + wander + step`` at our time ``t``."""

    offset: float = 1000.0
    ppm: float = 100.0
    wander_s: float = 0.0
    period_s: float = 200.0
    step_s: float = 0.0
    step_at: float = np.inf

    def __call__(self, t):
        wander = self.wander_s * np.sin(2 * np.pi * (t - 100.0) / self.period_s)
        drift = self.ppm * 1e-6 * (t - 100.0)
        return t + self.offset + drift + wander + np.where(t >= self.step_at, self.step_s, 0.0)


def probe(clock: Callable, start: float, stop: float, random, *, every=1.0, way_s=15e-6, reply_s=0):
    """Probe as liblsl does: the exchange with the shortest round trip of eight, 64 ms apart."""
    rows = []
    for begin in np.arange(start, stop, every):
        sent = begin + 0.064 * np.arange(8)
        there = sent + way_s * (1 + random.exponential(0.2, 8))
        back = there + way_s * (1 + random.exponential(0.2, 8)) + random.exponential(reply_s, 8)
        k = np.argmin(back - sent)
        remote = clock(there[k])
        rows.append((remote, (sent[k] + back[k]) / 2 - remote, back[k] - sent[k], begin + 0.5))
    return np.array(rows)


def arrivals(times, *, every=0.03, travel_s=200e-6):
    """Return what a recorder notes that pulls at steady intervals."""
    pulled = np.ceil((np.maximum.accumulate(times) + travel_s) / every) * every
    last = np.flatnonzero(np.r_[np.diff(pulled) > 0, True])
    return np.column_stack([last + 1.0, pulled[last]])


def source(clock, times, random, *, stamped=None, travel_s=200e-6, every=1.0, reply_s=0.0):
    """Return what is received of a source that samples at ``times`` of our clock."""
    span = times[0] + 0.3, times[-1] + 1.0
    return RawStream(
        clock(times if stamped is None else stamped),
        probes=probe(clock, *span, random, every=every, reply_s=reply_s),
        arrivals=arrivals(times if stamped is None else stamped, travel_s=travel_s),
    )


def after_one_another(first: RawStream, second: RawStream, told: float) -> RawStream:
    """Return two sources received as one, the second in place of the first."""
    n = len(first.stamps)
    later = second.arrivals + np.array([n, 0.0])
    return RawStream(
        np.r_[first.stamps, second.stamps],
        probes=np.concatenate([first.probes, second.probes]),
        arrivals=np.concatenate([first.arrivals, later]),
        resets=np.array([[told, n, n]]),
    )
