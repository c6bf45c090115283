"""Step response of a joint: the valve's dead time and the lag with which it opens."""

from collections.abc import Sequence

import numpy as np

from labcrane import FloatArray
from labcrane_dmd.fit.recordings import JointRun
from labcrane_dmd.model.model import Direction
from labcrane_dmd.model.settings import Between

WATCHED_S = 1.5
"""Time after the step that is compared with the recording."""

LONGEST_S = 0.6
COARSE_S, FINE_S = 0.02, 0.002

SIGNALS, ANGLES = 26, 80
"""Number of points in the table of speeds; speeds between them are interpolated linearly."""


def identify(
    direction: Direction,
    runs: Sequence[JointRun],
    between: Between,
    around: tuple[float, float] | None = None,
) -> tuple[float, float]:
    """Return dead time and lag in seconds with which the model follows the recordings best.

    The valve's opening, which is the signal beyond the dead band, is first order; the joint moves
    at the speed of the opening reached (docs/decisions/0050). They are looked for within 20 ms of
    ``around``, if it is given, and up to 0.6 s otherwise.
    """
    tables = [_SetOff(direction, run, between) for run in runs]
    delays = np.arange(0.0, LONGEST_S + COARSE_S / 2, COARSE_S)
    dead_time, lag = around or _best(tables, delays, delays)
    near = np.arange(-COARSE_S, COARSE_S + FINE_S / 2, FINE_S)
    dead_time, lag = _best(tables, np.maximum(dead_time + near, 0.0), np.maximum(lag + near, 0.0))
    return round(dead_time, 4), round(lag, 4)


def _best(
    tables: Sequence["_SetOff"], dead_times: FloatArray, lags: FloatArray
) -> tuple[float, float]:
    pairs = np.array([(dead, lag) for dead in dead_times for lag in lags])
    error = sum((table.error(pairs[:, 0], pairs[:, 1]) for table in tables), np.zeros(len(pairs)))
    dead_time, lag = pairs[int(error.argmin())]
    return float(dead_time), float(lag)


class _SetOff:
    """The first moments of one run, and the model's speeds around there."""

    def __init__(self, direction: Direction, run: JointRun, between: Between) -> None:
        last = run.step + int(WATCHED_S / run.interval)
        self._angle = run.angle[run.step : last]
        self._time = run.time[run.step : last] - run.time[run.step]
        self._rest = float(np.mean(run.angle[: run.step])) if run.step else float(run.angle[0])
        margin = 0.02
        self._lowest = min(float(self._angle.min()), self._rest) - margin
        highest = max(float(self._angle.max()), self._rest) + margin
        self._step = (highest - self._lowest) / (ANGLES - 1)
        self._size = abs(run.signal)
        self._speeds = np.array(
            [
                [
                    direction.speed(size, self._lowest + place * self._step, between)
                    for place in range(ANGLES)
                ]
                for size in np.linspace(min(direction.dead_band, self._size), self._size, SIGNALS)
            ]
        )

    def error(self, dead_time: FloatArray, lag: FloatArray) -> FloatArray:
        """Return the sum of squared differences in rad² for each pair of delays."""
        angle = np.full(len(dead_time), self._rest)
        error: FloatArray = (angle - self._angle[0]) ** 2
        lag = np.maximum(lag, 1e-6)
        for before, now, seen in zip(self._time[:-1], self._time[1:], self._angle[1:], strict=True):
            waited = np.maximum(0.5 * (before + now) - dead_time, 0.0)
            angle = angle + (now - before) * self._speed(1.0 - np.exp(-waited / lag), angle)
            error += (angle - seen) ** 2
        return error

    def _speed(self, opening: FloatArray, angle: FloatArray) -> FloatArray:
        row = opening * (SIGNALS - 1)
        column = np.clip((angle - self._lowest) / self._step, 0.0, ANGLES - 1.0)
        i = np.minimum(row.astype(int), SIGNALS - 2)
        j = np.minimum(column.astype(int), ANGLES - 2)
        p, q, table = row - i, column - j, self._speeds
        low = (1 - q) * table[i, j] + q * table[i, j + 1]
        high = (1 - q) * table[i + 1, j] + q * table[i + 1, j + 1]
        return np.asarray((1 - p) * low + p * high)
