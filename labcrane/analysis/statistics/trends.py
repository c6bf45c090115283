"""Linear trend of a measure along the session."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from labcrane.analysis.statistics.rounding import alike, without_rounding

if TYPE_CHECKING:
    import pandas as pd

LEAST = 3
"""Fewest participants of a test; with fewer, their variance is unknown."""


@dataclass(frozen=True, slots=True)
class Trend:
    """The test of each participant's slope against zero.

    Attributes
    ----------
    measure, along
        What changes, over what.
    slope, slope_ci
        Mean of the participants' least-squares slopes, in the measure's unit per step, with its
        95 % confidence interval.
    t, df, p
        The two-sided t test.
    dz
        Effect size: mean slope over the slopes' standard deviation.
    n
        Participants.
    people
        Who they are.
    phase
        The session or block, where it is of one.
    confounded
        What it cannot be distinguished from, in words; empty if nothing, or not tested.
    p_holm
        The same corrected for all trends of primary outcomes; NaN of others.
    """

    measure: str
    along: str
    slope: float
    slope_ci: tuple[float, float]
    t: float
    df: float
    p: float
    dz: float
    n: int
    people: tuple[str, ...]
    phase: str = ""
    confounded: str = ""
    p_holm: float = float("nan")


def linear_trend(movements: "pd.DataFrame", measure: str) -> Trend | None:
    """Test for a linear trend over the sequence; None with fewer than three slopes.

    An F test over all positions says that some differ; only this says in which direction.
    """
    from scipy.stats import ttest_1samp

    found, people = [], []
    for name, own in movements.groupby("participant"):
        means = own.groupby("sequence")[measure].mean().dropna()
        if len(means) > 1:
            found.append(float(np.polyfit(means.index.to_numpy(float), means.to_numpy(), 1)[0]))
            people.append(str(name))
    if len(found) < LEAST:
        return None
    slopes = without_rounding(np.array(found), movements[measure].dropna().to_numpy(float))
    if alike(slopes):
        return None
    test = ttest_1samp(slopes, 0.0)
    low, high = test.confidence_interval(0.95)
    return Trend(
        measure,
        "sequence",
        slope=float(np.mean(slopes)),
        slope_ci=(float(low), float(high)),
        t=float(test.statistic),
        df=float(test.df),
        p=float(test.pvalue),
        dz=float(np.mean(slopes) / np.std(slopes, ddof=1)),
        n=len(slopes),
        people=tuple(people),
    )


def holm(p: Sequence[float]) -> list[float]:
    """Return p-values corrected after Holm (1979); a NaN is not a test and is not counted.

    The smallest is multiplied by the number of tests, the next by the number that are left, and
    none is below the one before it.
    """
    # statsmodels' multipletests collects all garbage in every call, a fifth of a second.
    corrected, largest = list(p), 0.0
    tested = sorted((value, at) for at, value in enumerate(p) if not math.isnan(value))
    for number, (value, at) in enumerate(tested):
        largest = max(largest, min(1.0, value * (len(tested) - number)))
        corrected[at] = largest
    return corrected
