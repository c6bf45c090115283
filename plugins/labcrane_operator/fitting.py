"""Fit of an operator to strokes, with 95 % intervals."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from labcrane import FloatArray, RecordingError
from labcrane_operator.noise import SIDE_SHARE
from labcrane_operator.strokes import Strokes

FEWEST = 8
"""Strokes from which a curve of four parameters has an interval worth the name."""

LEAST_SPREAD_BIT = 0.5
"""Spread of difficulties below which slope and intercept cannot be distinguished."""

LAPSE_SD, LAPSE_S = 4.0, 0.5
"""A reaction is a lapse if it exceeds the median by this many standard deviations of the logarithm,
and by this many seconds."""

NAMES = ("fitts_a_s", "fitts_b_s", "learning_gain", "learning_rate")
LOWEST = (1e-6, 0.0, 1e-4)
"""Of all but the intercept."""

HIGHEST = (np.inf, np.inf, 20.0, 5.0)

Interval = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Estimate:
    """A setting of the simulated operator, as fitted.

    Attributes
    ----------
    value
        In the setting's unit.
    interval
        95 % confidence interval; None where there is none.
    """

    value: float
    interval: Interval | None


def fit_operator(strokes: Strokes) -> Mapping[str, Estimate]:
    """Return the settings of the simulated operator that the strokes tell, by name.

    ``learning_rate`` is missing when no learning was found (``learning_gain`` is then 0), and
    ``lapse_s`` when there was no lapse.

    Raises
    ------
    RecordingError
        There are too few strokes, or all are of one difficulty.
    """
    if len(strokes) < FEWEST:
        raise RecordingError(
            f"there are {len(strokes)} movements with a main stroke, and an operator is fitted to "
            f"at least {FEWEST}; choose a longer session with --session"
        )
    return {**_reaction(strokes.reaction), **_duration(strokes), **_scatter(strokes.miss)}


def _reaction(reaction: FloatArray) -> dict[str, Estimate]:
    from scipy.stats import t  # noqa: PLC0415 - loaded when it is used

    known = reaction[np.isfinite(reaction) & (reaction > 0.0)]
    if len(known) < FEWEST:
        raise RecordingError(
            f"{len(known)} movements have a time of their first command after the target, and "
            f"reaction_s is fitted to at least {FEWEST}; choose a longer session with --session"
        )
    late = _lapses(known)
    logs = np.log(known[~late])
    n, mean, sd = len(logs), float(logs.mean()), float(logs.std(ddof=1))
    reach = float(t.ppf(0.975, n - 1)) * sd / math.sqrt(n)
    median = math.exp(mean)
    found = {
        "reaction_s": Estimate(median, (math.exp(mean - reach), math.exp(mean + reach))),
        "reaction_sd": Estimate(sd, _sd_interval(sd, n - 1)),
        "lapse_rate": _share(int(late.sum()), len(known)),
    }
    if late.sum() > 1:
        delays = known[late] - median
        reach = float(t.ppf(0.975, len(delays) - 1) * delays.std(ddof=1)) / math.sqrt(len(delays))
        mean = float(delays.mean())
        found["lapse_s"] = Estimate(mean, (mean - reach, mean + reach))
    return found


def _lapses(reaction: FloatArray) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Say which reactions are lapses; median and spread are those that a few lapses leave alone."""
    logs = np.log(reaction)
    median = float(np.median(logs))
    sd = 1.4826 * float(np.median(np.abs(logs - median)))
    late: np.ndarray[tuple[int], np.dtype[np.bool_]] = (logs > median + LAPSE_SD * sd) & (
        reaction > math.exp(median) + LAPSE_S
    )
    return late


def _share(count: int, n: int) -> Estimate:
    """Return a probability with the interval of Clopper and Pearson (1934)."""
    from scipy.stats import binomtest  # noqa: PLC0415 - loaded when it is used

    low, high = binomtest(count, n).proportion_ci()
    return Estimate(count / n, (float(low), float(high)))


def _sd_interval(sd: float, free: int) -> Interval:
    """Return the interval of a normal distribution's standard deviation."""
    from scipy.stats import chi2  # noqa: PLC0415 - loaded when it is used

    low, high = (sd * math.sqrt(free / float(chi2.ppf(p, free))) for p in (0.975, 0.025))
    return low, high


def _scatter(miss: FloatArray) -> dict[str, Estimate]:
    """Return the scatter of ends about the target's centre, along the way and across it."""
    draws = miss / np.array([1.0, SIDE_SHARE, SIDE_SHARE])
    sd = math.sqrt(float(np.mean(draws**2)))
    return {"endpoint_noise": Estimate(sd, _sd_interval(sd, draws.size))}


def _duration(strokes: Strokes) -> dict[str, Estimate]:
    """Fit Fitts' law and the learning curve, which multiply, to the durations' logarithms."""
    bits = np.log2(strokes.distance / strokes.width + 1.0)
    if np.ptp(bits) < LEAST_SPREAD_BIT:
        raise RecordingError(
            f"the movements' difficulties differ by {np.ptp(bits):.2f} bit, and fitts_a_s and "
            f"fitts_b_s can be told apart from {LEAST_SPREAD_BIT:g} bit on; choose a session with "
            "several distances or widths"
        )
    law = _Curve(bits, strokes.trial - 1.0, np.log(strokes.duration))
    free = law.best(lowest_intercept=-np.inf)
    if free.values[0] >= 0.0:
        return free.estimates(free.values)
    # An operator cannot have an intercept below 0. The intervals are those of the free fit: at a
    # bound, the curvature contains no information about the bounded parameter.
    return free.estimates(law.best(lowest_intercept=0.0, learning=free.learning).values)


@dataclass(frozen=True, slots=True)
class _Curve:
    """log(a + b · bits) + log(1 + gain · exp(-rate · practice)), against observed logarithms."""

    bits: FloatArray
    practice: FloatArray
    logs: FloatArray

    def off(self, values: FloatArray) -> FloatArray:
        a, b, *learning = values
        away: FloatArray = np.log(np.maximum(a + b * self.bits, 1e-9)) - self.logs
        if learning:
            gain, rate = learning
            away = away + np.log1p(gain * np.exp(-rate * self.practice))
        return away

    def best(self, *, lowest_intercept: float, learning: bool | None = None) -> "_Fit":
        """Fit with and without learning, and return the better one, or the one that is asked for.

        A learning curve that does not fit better than none cannot be distinguished from chance.
        """
        slope, intercept = np.polyfit(self.bits, np.exp(self.logs), 1)
        start = [max(float(intercept), 0.01), max(float(slope), 0.01)]
        plain = self._fit(start, lowest_intercept)
        tries = [self._fit([*start, 0.3, rate], lowest_intercept) for rate in (0.02, 0.1, 0.4)]
        learnt = min(tries, key=lambda fit: fit.squares)
        if learning is None:
            learning = learnt.aicc < plain.aicc
        return learnt if learning else plain

    def _fit(self, start: list[float], lowest_intercept: float) -> "_Fit":
        from scipy.optimize import least_squares  # noqa: PLC0415 - loaded when it is used

        k = len(start)
        found = least_squares(
            self.off,
            start,
            bounds=((lowest_intercept, *LOWEST)[:k], HIGHEST[:k]),
            x_scale=np.maximum(start, 0.01),
        )
        return _Fit(list(map(float, found.x)), 2.0 * float(found.cost), found.jac, len(self.logs))


@dataclass(frozen=True, slots=True)
class _Fit:
    """Values at the smallest sum of squares, and the curvature there."""

    values: list[float]
    squares: float
    jacobian: FloatArray
    n: int

    @property
    def aicc(self) -> float:
        """Akaike's criterion, corrected for few points; the lower one fits better."""
        k = len(self.values) + 1  # and the variance
        likelihood = self.n * math.log(max(self.squares, 1e-300) / self.n)
        return likelihood + 2 * k + 2 * k * (k + 1) / (self.n - k - 1)

    @property
    def learning(self) -> bool:
        """Whether a learning curve is among the values."""
        return len(self.values) == len(NAMES)

    def estimates(self, values: list[float]) -> dict[str, Estimate]:
        """Return the values with Student's intervals about this fit's own.

        Those of gain and rate are intervals of their logarithms.
        """
        from scipy.stats import t  # noqa: PLC0415 - loaded when it is used

        free = self.n - len(self.values)
        covariance = np.linalg.pinv(self.jacobian.T @ self.jacobian) * self.squares / free
        reaches = float(t.ppf(0.975, free)) * np.sqrt(np.diag(covariance))
        found = {}
        for name, value, own, reach in zip(
            NAMES, values, self.values, reaches.tolist(), strict=False
        ):
            if name.startswith("learning"):
                share = math.exp(min(reach / own, 50.0)) if own > 0.0 else math.inf
                found[name] = Estimate(value, (own / share, own * share))
            else:
                found[name] = Estimate(value, (own - reach, own + reach))
        if not self.learning:
            found["learning_gain"] = Estimate(0.0, None)
        return found
