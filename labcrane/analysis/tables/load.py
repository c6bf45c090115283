"""Measures of mental load: one row per measure, person and condition, and how they correlate."""

from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from labcrane.analysis.report.factors import CONDITION

if TYPE_CHECKING:
    import pandas as pd

BODY = ("duty_cycle", "aggressiveness", "steering_entropy", "heart_rate", "pupil")
"""Measures of movements beside those of tasks and questionnaires."""

RATE, TIME = "_hit_rate", "_response_time"
FEWEST = 3
"""With fewer values of a person in a condition there is no interval."""


def load_table(results: "pd.DataFrame", scores: "pd.DataFrame") -> "pd.DataFrame":
    """Return mean, 95 % interval and n of each measure, person and condition.

    Measures are the scores of the NASA-TLX, the responses of secondary tasks, how the sticks were
    worked, and heart rate and pupil where they were recorded. Response times are means of all hits
    of a condition, and hit rates of all its stimuli. Intervals are by t over movements, and of hit
    rates after Wilson. Empty without conditions or without a secondary task.

    Parameters
    ----------
    results
        Movements that are results.
    scores
        Scores of questionnaires with their ``condition``.
    """
    import pandas as pd
    from scipy.stats import t

    columns = [str(name) for name in results]
    of_drt = [name.removesuffix(RATE) for name in columns if name.endswith(RATE)]
    rates = [
        name + RATE
        for name in of_drt  # a plugin may call a result of its own so
        if {name + kind for kind in (TIME, "_hits", "_misses")} <= {*columns}
    ]
    asked = [name.replace(RATE, TIME) for name in rates]
    if CONDITION not in results or not rates:
        return pd.DataFrame()
    keys = ["participant", CONDITION]
    of_body = [name for name in BODY if name in results]
    long = [results.melt(keys, [*asked, *of_body], "measure")]
    if len(scores):
        tlx = scores[scores["version"].str.startswith("nasa_tlx ") & (scores[CONDITION] != "")]
        named = "TLX " + tlx["score"].astype(str)
        long.insert(0, tlx[[*keys, "value"]].assign(measure=named))
    values = pd.concat(long, ignore_index=True).dropna(subset=["value"])
    values = values[values[CONDITION].fillna("") != ""]
    cells = values.groupby(["measure", *keys], sort=False)["value"]
    table = cells.agg(mean="mean", sd="std", n="count").reset_index()
    quantile = t.ppf(0.975, np.maximum(table["n"] - 1, 1))
    reach = (quantile * table.pop("sd") / np.sqrt(table["n"])).where(table["n"] >= FEWEST)
    for rate, time in zip(rates, asked, strict=True):
        _weigh(table, results, time, rate.replace(RATE, "_hits"), keys)
    table = table.assign(ci_low=table["mean"] - reach, ci_high=table["mean"] + reach)
    return pd.concat([table, *(_rates(results, name, keys) for name in rates)], ignore_index=True)


def _weigh(
    table: "pd.DataFrame", results: "pd.DataFrame", time: str, hits: str, keys: list[str]
) -> None:
    """Let each mean of a response time be that of hits, not of movements with few or many."""
    known = results[[*keys, time, hits]].dropna()
    totals = known.assign(total=known[time] * known[hits]).groupby(keys)[["total", hits]].sum()
    own = table["measure"] == time
    cells = totals.reindex(list(zip(*(table.loc[own, key] for key in keys), strict=True)))
    table.loc[own, "mean"] = (cells["total"] / cells[hits]).to_numpy()


def _rates(results: "pd.DataFrame", rate: str, keys: list[str]) -> "pd.DataFrame":
    """Return a hit rate with its interval after Wilson, of each person and condition."""
    import pandas as pd
    from scipy.stats import binomtest

    counts = [rate.replace(RATE, kind) for kind in ("_hits", "_misses")]
    own = results[results[CONDITION].fillna("") != ""]
    rows = []
    for (person, condition), cell in own.groupby(keys, sort=False):
        hits, misses = (int(cell[name].sum()) for name in counts)
        if hits + misses:
            interval = binomtest(hits, hits + misses).proportion_ci(method="wilson")
            mean = hits / (hits + misses)
            rows.append((rate, person, condition, mean, hits + misses, interval.low, interval.high))
    columns = ["measure", *keys, "mean", "n", "ci_low", "ci_high"]
    return pd.DataFrame(rows, columns=columns)


def correlations(table: "pd.DataFrame") -> "pd.DataFrame":
    """Return the correlation of every two measures within persons, over conditions.

    The repeated measures correlation of Bland and Altman (1995, BMJ 310:446), with the interval of
    Bakdash and Marusich (2017, Frontiers in Psychology 8:456).
    """
    import pandas as pd

    cells = table.pivot_table("mean", ["participant", CONDITION], "measure", sort=False)
    rows = []
    for first, second in combinations(map(str, cells), 2):
        both = cells[[first, second]].dropna()
        both = both[both.groupby("participant")[first].transform("size") > 1]
        people = both.index.get_level_values("participant").nunique()
        own = both - both.groupby("participant").transform("mean")
        freedom = len(both) - people - 1
        if freedom < FEWEST or not own.std().gt(0.0).all():
            continue
        a, b = own[first].to_numpy(float), own[second].to_numpy(float)
        r = float((a @ b) / np.sqrt((a @ a) * (b @ b)))
        z, reach = np.arctanh(min(max(r, -1.0), 1.0)), 1.96 / np.sqrt(freedom - 1)
        low, high = np.tanh(z - reach), np.tanh(z + reach)
        rows.append((first, second, r, low, high, freedom, people, len(both)))
    columns = ["first", "second", "r", "ci_low", "ci_high", "df", "participants", "cells"]
    return pd.DataFrame(rows, columns=columns)
