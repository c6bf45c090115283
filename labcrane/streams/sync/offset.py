"""Offset of a clock as a smooth function of its own time, and how well it is known."""

from dataclasses import dataclass

import numpy as np

from labcrane.streams.sync.clock_curve import Smoothed
from labcrane.streams.sync.raw import OFFSET, REMOTE, RTT
from labcrane.streams.sync.smoother import smooth
from labcrane.types import FloatArray

SURE = 1.96
"""Standard deviations on each side of which 95 % lie."""

SLEW = 1e-4
"""A lasting change of rate beyond this, in seconds per second, no crystal does by itself."""

AROUND = 5
ONE_WAY = 0.15

CONGESTED_S = 1e-3
LONG = 5

COARSE_S = (1.0 / 64.0, 0.01, 1e-3, 1e-4)
ENOUGH, NEARLY = 8, 1e-3
"""So many round trips of whole units of a clock, and so nearly whole, do not occur by chance."""


@dataclass(frozen=True, slots=True)
class OffsetCurve:
    """What must be added to a clock to have ours, at any of its times.

    Attributes
    ----------
    smoothed
        At the probes.
    probes
        What it rests on, in the order of the clock, shape ``(n, 4)``.
    least_rtt
        The shortest round trip: half of it bounds what a lasting asymmetry of the path can hide.
    """

    smoothed: Smoothed
    probes: FloatArray
    least_rtt: float

    def __call__(self, times: FloatArray) -> FloatArray:
        """Return the offset at times of the clock, shape ``(n,)``; goes on straight beyond."""
        return self.smoothed.at(times)[0]

    def with_error(self, times: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the offset, and how far it may be off at 95 %, in seconds, shape ``(n,)`` each."""
        offset, deviation = self.smoothed.at(times)
        # Where every exchange was long, what is known of the ways rests on a model of them.
        around = np.minimum.reduceat(
            np.pad(self.excess, AROUND, mode="edge"),
            np.column_stack([k := np.arange(len(self.probes)), k + 2 * AROUND]).ravel(),
        )[::2]
        held_up = ONE_WAY * np.interp(times, self.probes[:, REMOTE], around)
        stray = np.interp(times, self.probes[:, REMOTE], self._outside())
        hidden = self.least_rtt / 2.0 + _own_unit(self.probes[:, RTT])
        return offset, SURE * deviation + hidden + held_up + stray

    def _outside(self) -> FloatArray:
        """Return by how much the curve is where no ways of its probes could lie, shape ``(n,)``."""
        beyond = np.pad(np.maximum(np.abs(self.residuals) - self.probes[:, RTT] / 2.0, 0.0), 1)
        return np.asarray(np.maximum(np.maximum(beyond[:-2], beyond[2:]), beyond[1:-1]))

    @property
    def slope(self) -> float:
        """Usual change of the offset, in seconds per second."""
        return float(np.median(self.smoothed.skew))

    @property
    def residuals(self) -> FloatArray:
        """How far the probes lie from the curve, in seconds, shape ``(n,)``."""
        return np.asarray(self.probes[:, OFFSET] - self(self.probes[:, REMOTE]))

    @property
    def excess(self) -> FloatArray:
        """By how much each round trip was longer than the shortest, in seconds, shape ``(n,)``."""
        return np.asarray(self.probes[:, RTT] - self.least_rtt)

    def slews(self) -> int:
        """Return how often its rate was changed at once."""
        skew, walk = self.smoothed.skew, self.smoothed.walk
        count, last = 0, -LONG
        usual = float(np.median(walk)) if len(walk) else 0.0
        for k in np.flatnonzero(walk > 4.0 * usual + 1e-12):
            before, after = skew[max(k - LONG, 0) : k], skew[k + 2 : k + 2 + LONG]
            if min(len(before), len(after)) < 2 or k - last < LONG:  # noqa: PLR2004
                continue
            if abs(float(np.median(after) - np.median(before))) > SLEW:
                count, last = count + 1, int(k)
        return count

    def congested_s(self) -> float:
        """Return for how long round trips were far longer than usual, one probe after the other."""
        excess = self.excess
        long = excess > CONGESTED_S + LONG * float(np.quantile(excess, 0.1))
        total = 0.0
        edges = np.flatnonzero(np.diff(np.r_[0, long.astype(int), 0]))
        for start, stop in edges.reshape(-1, 2):
            if stop - start >= LONG:
                total += float(self.probes[stop - 1, REMOTE] - self.probes[start, REMOTE])
        return total


def _own_unit(trips: FloatArray) -> float:
    """Return what our own clock counts in, if round trips are few whole units of it; else 0."""
    for unit in COARSE_S:
        parts = trips / unit
        whole = np.round(parts)
        if len(trips) >= ENOUGH and np.ptp(whole) > 0.0 and (np.abs(parts - whole) < NEARLY).all():
            return unit
    return 0.0


def fit(probes: FloatArray, usual_slope: float) -> OffsetCurve:
    """Fit a clock's offset to its probes.

    In the clock's own time at the probe and not in the time when the probe was looked at: pairing
    an offset with the moment it is read biases it by drift times age. A probe is trusted by how
    much longer its round trip was than the shortest of all, as NTP's huff-n'-puff filter does:
    that bounds what congestion on one way can have added.

    Parameters
    ----------
    probes
        Of one clock, at least one, shape ``(n, 4)``.
    usual_slope
        Of other clocks of this source: what a few probes in a short time leave open.
    """
    ordered = probes[np.argsort(probes[:, REMOTE], kind="stable")]
    least = float(ordered[:, RTT].min())
    excess = ordered[:, RTT] - least
    smoothed = smooth(ordered[:, REMOTE], ordered[:, OFFSET], excess, usual_slope)
    return OffsetCurve(smoothed, ordered, least)
