"""A clock's offset as a smooth function of its own time."""

from dataclasses import dataclass

import numpy as np

from labcrane.streams.sync.epochs import OFFSET, REMOTE, RTT
from labcrane.types import FloatArray

FEWEST = 6
"""Probes under the smoother: it widens until it covers as many."""

USUAL_SPREAD = 100e-6
"""How far clocks' rates usually differ, in seconds per second: what is known without probes."""

LEAST_RTT_S = 10e-6
"""Round trips are weighed no finer than this."""

NEAR_S = 30.0

ENOUGH = 20
"""Fewer probes say nothing of how offsets move with round trips."""

CLEAR = 4.0
"""Standard errors beyond which they do."""


@dataclass(frozen=True, slots=True)
class OffsetCurve:
    """What must be added to a clock to have ours, at any of its times.

    Attributes
    ----------
    at, offset
        Knots: the clock's own time and its offset, shape ``(n_knots,)``; straight in between.
    slope
        Mean change of the offset in seconds per second.
    residuals
        How far the probes lie from the curve, in seconds.
    trusted
        The probes it rests on, shape ``(n, 4)``.
    """

    at: FloatArray
    offset: FloatArray
    slope: float
    residuals: FloatArray
    trusted: FloatArray

    def __call__(self, times: FloatArray) -> FloatArray:
        """Return the offset at times of the clock, shape ``(n,)``; goes on straight beyond."""
        inside = np.interp(times, self.at, self.offset)
        return np.asarray(
            inside
            + self.slope * np.minimum(times - self.at[0], 0.0)
            + self.slope * np.maximum(times - self.at[-1], 0.0)
        )


def fit(
    probes: FloatArray, bandwidth_s: float, span: tuple[float, float], usual_slope: float
) -> OffsetCurve:
    """Fit a clock's offset to its probes.

    Local lines with tricube weights, in the clock's own time at the probe and not in the time when
    the probe was looked at: pairing an offset with the moment it is read biases it by drift times
    age. Probes weigh by the inverse square of their round trip, which bounds how wrong they are.

    Parameters
    ----------
    probes
        Of one clock, at least one, shape ``(n, 4)``.
    bandwidth_s
        Reach of the smoother to each side.
    span
        First and last time at which the curve will be asked for.
    usual_slope
        Of other clocks of this source: what a few probes in a short time leave open.
    """
    trusted = _trusted(probes[np.argsort(probes[:, REMOTE])])
    trusted = _without_one_sided_delay(trusted, bandwidth_s)
    smoother = _Smoother(trusted, bandwidth_s, usual_slope)
    residuals = trusted[:, OFFSET] - smoother.at(trusted[:, REMOTE])
    spread = 1.4826 * float(np.median(np.abs(residuals))) + 1e-6
    good = np.abs(residuals) < 5.0 * spread
    if not good.all() and np.count_nonzero(good) >= FEWEST:
        trusted = trusted[good]
        smoother = _Smoother(trusted, bandwidth_s, usual_slope)
        residuals = trusted[:, OFFSET] - smoother.at(trusted[:, REMOTE])
    knots = np.unique(np.r_[span, trusted[:, REMOTE]])
    return OffsetCurve(knots, smoother.at(knots), smoother.slope, residuals, trusted)


def _trusted(probes: FloatArray) -> FloatArray:
    """Return the probes whose round trip is not much longer than most around them."""
    times, trips = probes[:, REMOTE], probes[:, RTT]
    first = np.searchsorted(times, times - NEAR_S)
    last = np.searchsorted(times, times + NEAR_S, side="right")
    limit = [1.5 * np.quantile(trips[i:j], 0.6) for i, j in zip(first, last, strict=True)]
    return np.asarray(probes[trips <= np.maximum(limit, LEAST_RTT_S)])


def _without_one_sided_delay(probes: FloatArray, bandwidth_s: float) -> FloatArray:
    """Return the probes with the part of their error taken out that their round trips explain.

    A delay on one way alone shifts the offset by half of it. How much longer than the shortest a
    round trip is, is known; which way it was longer is the same for most, and is seen in how
    offsets move with round trips. What the shortest round trip hides stays hidden.
    """
    if len(probes) < ENOUGH:
        return probes
    times, trips = probes[:, REMOTE], probes[:, RTT]
    rest = probes[:, OFFSET] - _Smoother(probes, bandwidth_s, 0.0).at(times)
    as_offsets = probes.copy()
    as_offsets[:, OFFSET] = trips
    excess = trips - _Smoother(as_offsets, bandwidth_s, 0.0).at(times)
    spread = float(np.sqrt(excess @ excess))
    if spread < LEAST_RTT_S:
        return probes
    share = float(excess @ rest) / spread**2
    noise = float(np.std(rest - share * excess)) / spread
    if abs(share) < CLEAR * noise:
        return probes
    first = np.searchsorted(times, times - NEAR_S)
    last = np.searchsorted(times, times + NEAR_S, side="right")
    shortest = np.array([trips[i:j].min() for i, j in zip(first, last, strict=True)])
    cleared = probes.copy()
    cleared[:, OFFSET] -= min(max(share, -0.5), 0.5) * (trips - shortest)
    return cleared


class _Smoother:
    """Weighted local lines through probes of one clock."""

    def __init__(self, probes: FloatArray, bandwidth_s: float, usual_slope: float) -> None:
        self._time, self._offset = probes[:, REMOTE], probes[:, OFFSET]
        # The path's asymmetry is seldom more than a quarter of the round trip: the weight is an
        # inverse variance.
        self._weight = (np.maximum(probes[:, RTT], LEAST_RTT_S) / 4) ** -2
        self._bandwidth = bandwidth_s
        self.slope = usual_slope
        _, _, self.slope = self._line(slice(0, len(probes)), self._weight)

    def at(self, times: FloatArray) -> FloatArray:
        """Return the offset at the clock's times, shape ``(n,)``."""
        return np.array([self._one(float(time)) for time in times])

    def _one(self, time: float) -> float:
        centre = min(max(time, float(self._time[0])), float(self._time[-1]))
        reach = max(self._bandwidth, self._distance(centre))
        near = slice(*np.searchsorted(self._time, (centre - reach, centre + reach)))
        distance = np.abs(self._time[near] - centre) / reach
        weight = np.clip(1.0 - distance**3, 0.0, None) ** 3 * self._weight[near]
        middle, mean, slope = self._line(near, weight)
        return mean + slope * (time - middle)

    def _distance(self, centre: float) -> float:
        """Return how far the smoother must reach to cover enough probes."""
        k = int(np.searchsorted(self._time, centre))
        near = np.abs(self._time[max(k - FEWEST, 0) : k + FEWEST] - centre)
        near.sort()
        return float(near[min(FEWEST, len(near)) - 1]) * 1.01 + 1e-3

    def _line(self, near: slice, weight: FloatArray) -> tuple[float, float, float]:
        """Return a line's middle, its value there, and its slope."""
        time, offset = self._time[near], self._offset[near]
        total = weight.sum()
        middle, mean = float(weight @ time) / total, float(weight @ offset) / total
        away = time - middle
        usual = USUAL_SPREAD**-2
        pull = float(weight @ (away * (offset - mean))) + usual * self.slope
        return middle, mean, pull / (float(weight @ away**2) + usual)
