"""Share of cohorts in which a test shows what it is to show, and how far off it may be."""

import numpy as np
import numpy.typing as npt

from labcrane.types import FloatArray

LEVEL = 0.95
"""Of the intervals."""


def share_of(
    found: npt.NDArray[np.bool_],
    score: FloatArray | None = None,
    drawn: npt.NDArray[np.intp] | None = None,
    pool: int = 0,
) -> tuple[float, float, float]:
    """Return the share of cohorts that found something, and its 95 % interval.

    Where each cohort consists of participants of its own it is Wilson's. Cohorts that are drawn
    from a pool have the pool's own chance in common, however many are drawn. What it adds to the
    variance is the infinitesimal jackknife's (Efron 2014, J. Am. Stat. Assoc. 109, 991-1007): the
    sum, over the pool, of the squared covariance between how often a participant was drawn and
    what was found, less what the drawing adds to that sum by itself (Wager, Hastie and Efron 2014,
    J. Mach. Learn. Res. 15, 1625-1651) but for its standard error. The interval is symmetric on
    the probit scale, where a power is a straight line over the effect, with the quantile of t of
    as many participants.

    Parameters
    ----------
    found
        Of each cohort, shape ``(cohorts,)``.
    score
        The normal score of each cohort's p, shape ``(cohorts,)``. Where nearly all cohorts or none
        found something, what was found says little of the pool, and its score still does: the
        larger of both variances counts.
    drawn
        Numbers of the participants in each cohort, shape ``(cohorts, size)``; None where each has
        participants of its own.
    pool
        How many participants are drawn from.
    """
    share = float(found.mean())
    low, high = _wilson(found) if drawn is None else _of_pool(found, score, drawn, pool)
    # With none or all the interval ends at 0 or 1, which rounding misses by 1e-16 to either side.
    return share, min(low, share), max(high, share)


def _wilson(found: npt.NDArray[np.bool_]) -> tuple[float, float]:
    from statsmodels.stats.proportion import proportion_confint  # noqa: PLC0415 - loads for seconds

    low, high = proportion_confint(int(found.sum()), len(found), 1.0 - LEVEL, method="wilson")
    return float(low), float(high)


def _of_pool(
    found: npt.NDArray[np.bool_],
    score: FloatArray | None,
    drawn: npt.NDArray[np.intp],
    pool: int,
) -> tuple[float, float]:
    from scipy.stats import norm, t  # noqa: PLC0415 - loads for a second

    cohorts = len(found)
    # Of none or all of them the probit is infinite: half a cohort stands for less than one.
    share = float(np.clip(found.mean(), 0.5 / cohorts, 1.0 - 0.5 / cohorts))
    probit = norm.ppf(share)
    steepness = norm.pdf(probit)
    by_pool = _jackknife(found.astype(float), drawn, pool) / steepness**2
    if score is not None and (whole := float(score.var())) > 0.0:
        by_pool = max(by_pool, _jackknife(score, drawn, pool) / whole)
    by_drawing = share * (1.0 - share) / cohorts / steepness**2
    reach = t.ppf(0.5 + LEVEL / 2.0, pool - 1) * np.sqrt(by_pool + by_drawing)
    return float(norm.cdf(probit - reach)), float(norm.cdf(probit + reach))


def _jackknife(outcome: FloatArray, drawn: npt.NDArray[np.intp], pool: int) -> float:
    """Return the variance of a mean over cohorts that is the pool's.

    The drawing adds to the sum of squares the like of a chi-squared number of as many degrees of
    freedom as the pool has participants: one standard error of it is left in, so that few cohorts
    do not claim more than they know.
    """
    cohorts, size = drawn.shape
    apart = outcome - outcome.mean()
    together = np.bincount(drawn.ravel(), np.repeat(apart, size), minlength=pool) / cohorts
    by_drawing = size * outcome.var() / cohorts * (1.0 - np.sqrt(2.0 / pool))
    return max(float(together @ together - by_drawing), 0.0)
