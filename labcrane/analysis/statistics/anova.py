"""Repeated-measures analysis of variance with one factor within participants."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from labcrane.types import FloatArray

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, slots=True)
class Anova:
    """The test of one factor within participants.

    Attributes
    ----------
    measure, factor
        What was tested, over what.
    f
        The F ratio.
    df1, df2
        Degrees of freedom, not corrected.
    epsilon
        Greenhouse and Geisser's; multiplies both degrees of freedom.
    epsilon_hf
        Huynh and Feldt's, at most 1.
    p, p_gg
        Without a correction, and with Greenhouse and Geisser's.
    eta2p
        Partial eta squared, F·df1 / (F·df1 + df2).
    n
        Participants.
    left_out
        Participants without a value at some level, and therefore not in the test.
    """

    measure: str
    factor: str
    f: float
    df1: float
    df2: float
    epsilon: float
    epsilon_hf: float
    p: float
    p_gg: float
    eta2p: float
    n: int
    left_out: tuple[str, ...]


def repeated_measures(movements: "pd.DataFrame", measure: str, factor: str) -> Anova | None:
    """Test whether a measure's means differ over the levels of a factor.

    A participant's value at a level is the mean over their movements. F comes from statsmodels;
    epsilon of the covariance of the levels (Greenhouse & Geisser 1959, Psychometrika 24:95-112).

    Returns None with fewer than three whole participants or two levels.
    """
    from scipy.stats import f as f_distribution
    from statsmodels.stats.anova import AnovaRM

    cells = movements.groupby(["participant", factor])[measure].mean().unstack()
    whole = cells.dropna()
    left_out = tuple(map(str, cells.index.difference(whole.index)))
    n, levels = whole.shape
    if n < 3 or levels < 2:  # noqa: PLR2004 - fewer have no variance of the differences
        return None
    long = whole.reset_index().melt("participant", var_name=factor, value_name="value")
    row = AnovaRM(long, "value", "participant", within=[factor]).fit().anova_table.iloc[0]
    f, df1, df2 = float(row["F Value"]), float(row["Num DF"]), float(row["Den DF"])
    epsilon = greenhouse_geisser(whole.to_numpy(float))
    return Anova(
        measure,
        factor,
        f,
        df1,
        df2,
        epsilon,
        _huynh_feldt(epsilon, n, levels),
        p=float(f_distribution.sf(f, df1, df2)),
        p_gg=float(f_distribution.sf(f, epsilon * df1, epsilon * df2)),
        eta2p=f * df1 / (f * df1 + df2),
        n=n,
        left_out=left_out,
    )


def greenhouse_geisser(values: FloatArray) -> float:
    """Return epsilon of a table with participants as rows and levels as columns.

    tr(S)² / ((k - 1) tr(S²)), S being the levels' covariance, centred in rows and columns.
    """
    levels = values.shape[1]
    centring = np.eye(levels) - 1.0 / levels
    covariance = centring @ np.cov(values, rowvar=False) @ centring
    return float(np.trace(covariance) ** 2 / ((levels - 1) * (covariance**2).sum()))


def _huynh_feldt(epsilon: float, n: int, levels: int) -> float:
    k = levels - 1
    return min(1.0, (n * k * epsilon - 2.0) / (k * (n - 1.0 - k * epsilon)))
