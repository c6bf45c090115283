"""Curve of a clock's offset: states at its measurements, and what lies between them."""

from dataclasses import dataclass

import numpy as np

from labcrane.types import FloatArray


@dataclass(frozen=True, slots=True)
class Smoothed:
    """Offset and skew at the times of measurements, and how well they are known.

    Attributes
    ----------
    time
        Ascending, in seconds, shape ``(n,)``.
    offset, skew
        In seconds and seconds per second, shape ``(n,)``.
    covariance
        Of offset and skew: variance, covariance, variance, shape ``(n, 3)``, in seconds.
    walk
        Variance by which skew walks in a second, between neighbours, shape ``(n - 1,)``.
    """

    time: FloatArray
    offset: FloatArray
    skew: FloatArray
    covariance: FloatArray
    walk: FloatArray

    def at(self, times: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return offset and its standard deviation at any times, shape ``(n_times,)`` each.

        Between two neighbours the mean of a walking skew is the cubic through both states; beyond
        the ends the last skew goes on, and is known ever less.
        """
        if len(self.time) < 2:  # noqa: PLR2004
            mean, deviation = np.full((2, len(times)), [[self.offset[0]], [0.0]])
            deviation[:] = np.sqrt(self.covariance[0, 0])
        else:
            mean, deviation = self._between(times)
        for beyond, end, walk in (
            (times < self.time[0], 0, self.walk[:1]),
            (times > self.time[-1], -1, self.walk[-1:]),
        ):
            away = times[beyond] - self.time[end]
            far = np.abs(away)
            p00, p01, p11 = self.covariance[end]
            grown = float(walk.sum()) * far**3 / 3.0
            mean[beyond] = self.offset[end] + self.skew[end] * away
            variance = p00 + 2.0 * away * p01 + away**2 * p11 + grown
            deviation[beyond] = np.sqrt(np.maximum(variance, 0.0))
        return mean, deviation

    def _between(self, times: FloatArray) -> tuple[FloatArray, FloatArray]:
        k = np.clip(np.searchsorted(self.time, times) - 1, 0, len(self.time) - 2)
        step = np.maximum(self.time[k + 1] - self.time[k], 1e-9)
        u = np.clip((times - self.time[k]) / step, 0.0, 1.0)
        a, b = self.offset[k], self.offset[k + 1]
        rise_a, rise_b = self.skew[k] * step, self.skew[k + 1] * step
        mean = (
            (1.0 + 2.0 * u) * (1.0 - u) ** 2 * a
            + u * (1.0 - u) ** 2 * rise_a
            + u**2 * (3.0 - 2.0 * u) * b
            + u**2 * (u - 1.0) * rise_b
        )
        known = (1.0 - u) * self.covariance[k, 0] + u * self.covariance[k + 1, 0]
        walked = self.walk[k] * step**3 * (u * (1.0 - u)) ** 3 / 3.0
        return mean, np.sqrt(np.maximum(known, 0.0) + walked)
