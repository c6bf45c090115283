"""Two time scales of learning: within sessions or blocks, and from one to the next."""

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import pandas as pd

LEAST = 3
"""Participants of a test."""

QUANTITIES = {
    "slope": "change per position within it, least squares",
    "gain": "its last position minus its first",
    "change": "its mean minus that of the one before",
    "warm-up decrement": "its first position minus the last of the one before",
    "retention": "its last position minus the last of the one before",
}
"""What is worked out of each participant's session or block."""


def taken_away(movements: "pd.DataFrame", measure: str) -> "pd.Series[float]":
    """Return a measure with the mean of each pair of targets taken away, and the whole mean added.

    Positions can then be compared though pairs come in another order for everybody. A pair's mean
    is over participants' means.
    """
    pair = next((name for name in ("pair", "distance") if name in movements), None)
    if pair is None:
        return movements[measure].astype(float)
    means = movements.groupby(["participant", pair])[measure].mean().groupby(level=1).mean()
    return movements[measure] - movements[pair].map(means) + float(means.mean())


def quantities(movements: "pd.DataFrame", measure: str) -> "pd.DataFrame":
    """Return each participant's :data:`QUANTITIES`, one row per participant, phase and quantity.

    Parameters
    ----------
    movements
        With the columns ``phase`` (a session or block, in order) and ``place`` (position in it).
    """
    import pandas as pd

    own = movements.assign(value=taken_away(movements, measure))
    rows = []
    for participant, mine in own.groupby("participant"):
        before: pd.Series[float] | None = None
        for phase, part in mine.groupby("phase"):
            means = part.groupby("place")["value"].mean().dropna().sort_index()
            if means.empty:
                continue
            found = {}
            if len(means) > 1:
                found["slope"] = float(np.polyfit(means.index.to_numpy(float), means, 1)[0])
                found["gain"] = float(means.iloc[-1] - means.iloc[0])
            if before is not None:
                found["change"] = float(means.mean() - before.mean())
                found["warm-up decrement"] = float(means.iloc[0] - before.iloc[-1])
                found["retention"] = float(means.iloc[-1] - before.iloc[-1])
            about = {"participant": participant, "group": part["group"].iloc[0], "phase": phase}
            rows += [{**about, "quantity": name, "value": value} for name, value in found.items()]
            before = means
    return pd.DataFrame(rows, columns=["participant", "group", "phase", "quantity", "value"])


def summary(found: "pd.DataFrame", measure: str) -> "pd.DataFrame":
    """Return mean, confidence interval and t test against zero of each, for all and by group."""
    import pandas as pd
    from scipy.stats import ttest_1samp

    rows = []
    groups = [name for name in found["group"].unique() if name]
    for (phase, quantity), part in found.groupby(["phase", "quantity"], sort=False):
        parts = [("all", part)] + [(name, part[part["group"] == name]) for name in groups]
        for group, own in parts if len(groups) > 1 else parts[:1]:
            values = own["value"].to_numpy(float)
            row = {"measure": measure, "phase": phase, "quantity": quantity, "group": group}
            row |= {"n": len(values), "mean": float(values.mean()) if len(values) else np.nan}
            if len(values) >= LEAST and np.ptp(values) > 0.0:
                test = ttest_1samp(values, 0.0)
                low, high = test.confidence_interval(0.95)
                row |= {"ci_low": float(low), "ci_high": float(high), "t": float(test.statistic)}
                row |= {"df": float(test.df), "p": float(test.pvalue)}
            rows.append(row)
    names = ["measure", "phase", "quantity", "group", "n", "mean", "ci_low", "ci_high"]
    return pd.DataFrame(rows).reindex(columns=[*names, "t", "df", "p"])
