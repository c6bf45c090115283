"""Learning curves, fitted to each participant alone.

Averaged curves look like power functions even when no participant's is one (Heathcote, Brown &
Mewhort 2000, Psychonomic Bulletin & Review 7:185-207), so nothing is averaged before it is fitted.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from labcrane.types import FloatArray

if TYPE_CHECKING:
    import pandas as pd

PARAMETERS = 3
RATE_BOUNDS = (1e-3, 10.0)
"""Bounds of rates: beyond them a curve is a straight line, or ends before its second point."""


def exponential(n: FloatArray, asymptote: float, gain: float, rate: float) -> FloatArray:
    """Return asymptote + gain · exp(-rate · (n - 1)); n counts repetitions from 1."""
    curve: FloatArray = asymptote + gain * np.exp(-rate * (n - 1.0))
    return curve


def power(n: FloatArray, asymptote: float, gain: float, rate: float) -> FloatArray:
    """Return asymptote + gain · n ** -rate; n counts repetitions from 1."""
    curve: FloatArray = asymptote + gain * n ** (-rate)
    return curve


CURVES: dict[str, Callable[[FloatArray, float, float, float], FloatArray]] = {
    "exponential": exponential,
    "power": power,
}

RUNS: dict[str, Callable[[FloatArray], FloatArray]] = {
    "exponential": lambda n: n - 1.0,
    "power": np.log,
}
"""Run variable of a curve's gain: both are asymptote + gain · exp(-rate · run)."""

CLEARLY = 2.0
"""Difference of AICc from which one model is considered better than another."""

EDGE = 1e-3
"""Share of the values' spread within which an asymptote is at its bound."""

RATES = np.geomspace(*RATE_BOUNDS, 60)
"""Initial rates of a search."""


@dataclass(frozen=True, slots=True)
class LearningCurve:
    """One curve fitted to one participant.

    Attributes
    ----------
    curve
        ``exponential`` or ``power``.
    asymptote, gain
        Practised value and the first repetition's difference from it, in the measure's unit.
    rate
        Rate of the gain's decay, per repetition (exponential) or as an exponent (power).
    asymptote_se, gain_se, rate_se
        Standard errors from the curvature at the solution; infinite where it is flat.
    aicc
        Akaike's criterion corrected for few points; the lower one fits better. NaN with fewer
        than six points, for which the correction does not exist.
    identified
        Whether the data show an asymptote: the curve's AICc is lower by :data:`CLEARLY` than that
        of their mean and of a straight line, the asymptote's standard error is less than the spread
        of the points, and no parameter is at its bounds.
    n
        Number of points.
    """

    curve: str
    asymptote: float
    gain: float
    rate: float
    asymptote_se: float
    gain_se: float
    rate_se: float
    aicc: float
    identified: bool
    n: int

    def at(self, n: FloatArray) -> FloatArray:
        """Return the curve's values."""
        return CURVES[self.curve](n, self.asymptote, self.gain, self.rate)


def fit_curve(curve: str, n: FloatArray, values: FloatArray) -> LearningCurve | None:
    """Fit one curve by least squares with bounds; None with fewer points than parameters + 1.

    Gains may be negative: worsening is fitted as well. Values that are all positive, as times
    are, have an asymptote of 0 or more. The search starts at the best of many
    rates, as at each the other two follow from a straight line.
    """
    from scipy.optimize import least_squares

    known = np.isfinite(values)
    x, y = np.asarray(n, float)[known], np.asarray(values, float)[known]
    if len(x) <= PARAMETERS:
        return None
    run, spread = RUNS[curve](x), float(np.ptp(y)) or 1.0
    least = float(y.min()) - 2 * spread
    lower = [max(least, 0.0) if y.min() > 0.0 else least, -4 * spread, RATE_BOUNDS[0]]
    upper = [float(y.max()) + 2 * spread, 4 * spread, RATE_BOUNDS[1]]

    def misses(p: FloatArray) -> FloatArray:
        missed: FloatArray = p[0] + p[1] * np.exp(-p[2] * run) - y
        return missed

    def slopes(p: FloatArray) -> FloatArray:
        fall = np.exp(-p[2] * run)
        return np.column_stack([np.ones_like(run), fall, -p[1] * run * fall])

    best = least_squares(
        misses,
        _start(run, y, np.array(lower), np.array(upper)),
        slopes,
        bounds=(lower, upper),
        x_scale=[spread, spread, 1.0],
    )
    errors = _errors(best.jac, 2.0 * float(best.cost), len(x))
    asymptote, gain, rate = map(float, best.x)
    inside = RATE_BOUNDS[0] * 1.01 < rate < RATE_BOUNDS[1] * 0.99
    inside = inside and asymptote - lower[0] > EDGE * spread
    aicc = _aicc(2.0 * float(best.cost), len(x), PARAMETERS)
    plain = min(_aicc(squares, len(x), k) for k, squares in enumerate(_plain(x, y), start=1))
    return LearningCurve(
        curve,
        asymptote,
        gain,
        rate,
        *errors,
        aicc=aicc,
        identified=inside and errors[0] < float(y.std(ddof=1)) and aicc < plain - CLEARLY,
        n=len(x),
    )


def _start(run: FloatArray, y: FloatArray, lower: FloatArray, upper: FloatArray) -> FloatArray:
    """Return asymptote, gain and rate of the best curve within bounds at any of :data:`RATES`."""
    falls = np.exp(-np.outer(RATES, run))
    apart = falls - falls.mean(axis=1, keepdims=True)
    squares = (apart**2).sum(axis=1)
    gains = np.clip((apart @ (y - y.mean())) / squares, lower[1], upper[1])
    asymptotes = np.clip(y.mean() - gains * falls.mean(axis=1), lower[0], upper[0])
    costs = ((asymptotes[:, None] + gains[:, None] * falls - y) ** 2).sum(axis=1)
    at = int(np.argmin(costs))
    return np.array([asymptotes[at], gains[at], RATES[at]])


def _errors(jacobian: FloatArray, squares: float, n: int) -> tuple[float, float, float]:
    """Return the standard errors of the three parameters."""
    information = jacobian.T @ jacobian
    if np.linalg.cond(information) > 1.0 / np.finfo(float).eps:
        return math.inf, math.inf, math.inf
    covariance = np.linalg.inv(information) * squares / (n - PARAMETERS)
    asymptote, gain, rate = np.sqrt(np.clip(np.diag(covariance), 0.0, None))
    return float(asymptote), float(gain), float(rate)


def _plain(x: FloatArray, y: FloatArray) -> tuple[float, float]:
    """Return the sums of squares about the mean and about a straight line."""
    line = np.polynomial.Polynomial.fit(x, y, 1)
    return float(((y - y.mean()) ** 2).sum()), float(((y - line(x)) ** 2).sum())


def _aicc(squares: float, n: int, parameters: int) -> float:
    k = parameters + 1  # and the variance
    if n - k - 1 <= 0:
        return math.nan
    likelihood = n * math.log(max(squares, np.finfo(float).tiny) / n)
    return likelihood + 2 * k + 2 * k * (k + 1) / (n - k - 1)


def learning_curves(movements: "pd.DataFrame", measure: str) -> "pd.DataFrame":
    """Fit both curves to each participant's means of ``measure`` along the sequence.

    With a column ``phase``, each session or block has curves of its own, from its first position.
    Returns one row per participant, phase and curve; ``better`` is yes for the one with the lower
    AICc.
    """
    import pandas as pd

    rows: list[dict[str, object]] = []
    by = ["participant", *(name for name in ("phase",) if name in movements)]
    for key, own in movements.groupby(by):
        means = own.groupby("sequence")[measure].mean().dropna()
        n = means.index.to_numpy(float)
        fits = [fit_curve(curve, n, means.to_numpy(float)) for curve in CURVES]
        found = [fit for fit in fits if fit is not None]
        lowest = min((fit.aicc for fit in found), default=math.nan)
        rows += [
            {**dict(zip(by, key, strict=True)), "measure": measure}
            | {name: getattr(fit, name) for name in LearningCurve.__slots__}
            | {"better": "yes" if fit.aicc == lowest else "no"}
            | {"identified": "yes" if fit.identified else "no"}
            for fit in found
        ]
    return pd.DataFrame(rows)
