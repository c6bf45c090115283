"""Fitts' law: difficulty, effective difficulty, throughput and regression.

After Soukoreff & MacKenzie 2004 (Int J Human-Computer Studies 61:751-789).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from labcrane.types import FloatArray

if TYPE_CHECKING:
    import pandas as pd

WIDTH_FACTOR = math.sqrt(2.0 * math.pi * math.e)
"""4.133: an effective width holds the middle 96 % of normally distributed ends."""

POOL_BELOW = 15
"""Minimum number of ends for a condition's own width."""

CONDITION = ("distance", "width")
"""Columns that define the condition of a movement."""


def difficulty(distance: float, width: float) -> float:
    """Return the index of difficulty in bits, log2(distance / width + 1)."""
    return math.log2(distance / width + 1.0)


def effective_width(spread: float) -> float:
    """Return the effective width of a spread of ends (standard deviation), in its unit."""
    return WIDTH_FACTOR * spread


@dataclass(frozen=True, slots=True)
class Regression:
    """Movement time = intercept + slope · difficulty, by least squares, or the mean of such lines.

    Attributes
    ----------
    intercept, slope
        In s and s/bit.
    intercept_ci, slope_ci
        95 % confidence intervals.
    r2
        Share of variance explained; NaN for a mean of lines.
    n
        Number of points, or of lines.
    """

    intercept: float
    slope: float
    intercept_ci: tuple[float, float]
    slope_ci: tuple[float, float]
    r2: float
    n: int


def regress(difficulty_bit: FloatArray, movement_time: FloatArray) -> Regression | None:
    """Fit Fitts' law; None with fewer than three points or a single difficulty."""
    from scipy.stats import linregress, t

    x, y = np.asarray(difficulty_bit, float), np.asarray(movement_time, float)
    known = np.isfinite(x) & np.isfinite(y)
    x, y = x[known], y[known]
    if len(x) < 3 or np.ptp(x) == 0.0:  # noqa: PLR2004 - two points fit any line
        return None
    fit = linregress(x, y)
    reach = float(t.ppf(0.975, len(x) - 2))
    return Regression(
        intercept=float(fit.intercept),
        slope=float(fit.slope),
        intercept_ci=_around(fit.intercept, reach * fit.intercept_stderr),
        slope_ci=_around(fit.slope, reach * fit.stderr),
        r2=float(fit.rvalue) ** 2,
        n=len(x),
    )


def mean_line(lines: Sequence[Regression]) -> Regression | None:
    """Return the mean of participants' lines, with intervals over people; None for fewer than two.

    People differ, and each has several points: the points of all are not independent.
    """
    from scipy.stats import t

    if len(lines) < 2:  # noqa: PLR2004 - one line has no spread
        return None
    both = np.array([(line.intercept, line.slope) for line in lines])
    means = both.mean(axis=0)
    reach = float(t.ppf(0.975, len(lines) - 1)) * both.std(axis=0, ddof=1) / math.sqrt(len(lines))
    return Regression(
        intercept=float(means[0]),
        slope=float(means[1]),
        intercept_ci=_around(means[0], reach[0]),
        slope_ci=_around(means[1], reach[1]),
        r2=math.nan,
        n=len(lines),
    )


def _around(value: float, reach: float) -> tuple[float, float]:
    return float(value - reach), float(value + reach)


def throughput(movements: "pd.DataFrame") -> "pd.DataFrame":
    """Return each participant's throughput: the mean over conditions of IDe over mean MT.

    Of means, as ISO 9241-411 has it: a mean of single movements' ratios is higher, the more so the
    more their times vary. A condition is a distance and a width. Its effective width comes of the
    spread of its ends along the task axis. With fewer than :data:`POOL_BELOW` ends in a condition,
    the participant's conditions share one spread, each about its own mean; with fewer than that in
    all, all participants do.
    ``pooled`` says which. Where a task only ends inside the target, ends are cut off at its edge
    and throughput is flattered; ``bounded`` counts those ends.

    Parameters
    ----------
    movements
        Of :func:`labcrane.analysis.measures.measures_of`, successful ones only.
    """
    import pandas as pd

    movements = movements.dropna(subset=["movement_time", "amplitude", "error_along"])
    by = [name for name in CONDITION if name in movements]
    everybody = _spread(movements, ["participant", *by])
    rows = []
    for participant, own in movements.groupby("participant"):
        groups = [group for _, group in own.groupby(by, dropna=False)]
        few = min(len(group) for group in groups) < POOL_BELOW
        pooled = "no" if not few else "participant" if len(own) >= POOL_BELOW else "study"
        shared = everybody if pooled == "study" else _spread(own, by)
        bits = []
        for group in groups:
            spread = float(group["error_along"].std(ddof=1)) if pooled == "no" else shared
            effective = difficulty(float(group["amplitude"].mean()), effective_width(spread))
            bits.append(effective / float(group["movement_time"].mean()))
        rows.append(
            {
                "participant": participant,
                "throughput": float(np.mean(bits)),
                "effective_width": np.nan if pooled == "no" else effective_width(shared),
                "pooled": pooled,
                "movements": len(own),
                "bounded": int(own["error_bound"].notna().sum()) if "error_bound" in own else 0,
            }
        )
    return pd.DataFrame(rows)


def _spread(table: "pd.DataFrame", by: list[str]) -> float:
    """Return the standard deviation about the conditions' own means."""
    ends = table["error_along"]
    conditions = table.groupby(by, dropna=False)
    about = ends - conditions["error_along"].transform("mean")
    free = len(table) - conditions.ngroups
    return float(np.sqrt((about**2).sum() / free)) if free > 0 else float("nan")
