"""Two time scales of learning: within sessions or blocks, and from one to the next."""

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import pandas as pd

LEAST = 3
"""Participants of a test."""

QUANTITIES = {
    "slope": "change per position within it, least squares",
    "gain": "its last position minus its first",
    "change": "its mean minus that of the one before",
    "warm-up decrement": "its first position minus the last of the session before",
    "retention": "its last position minus the last of the session before",
}
"""What is worked out of each participant's session or block."""


def taken_away(movements: "pd.DataFrame", measure: str) -> "pd.Series[float]":
    """Return a measure with what each pair of targets adds taken away.

    Positions can then be compared though pairs come in another order for everybody. What a pair
    adds is its coefficient in least squares beside participant and position (in each phase), over
    their cells' means, and is 0 on average over pairs: means of pairs alone would take learning
    away with them wherever a pair came late more often than others. Where pairs cannot be told from
    positions and people, as when they come in one order for all, nothing is taken away.

    Parameters
    ----------
    movements
        With ``participant``, ``pair`` or ``distance``, and where there are some ``phase`` and
        ``place``.
    """
    pair = next((name for name in ("pair", "distance") if name in movements), None)
    if pair is None:
        return movements[measure].astype(float)
    where = [name for name in ("phase", "place") if name in movements]
    cells = movements.groupby(["participant", *where, pair])[measure].mean().dropna().reset_index()
    places = cells.groupby(where).ngroup().to_numpy() if where else np.zeros(len(cells), int)
    pairs, kinds = cells[pair].factorize(sort=True)
    beside = np.hstack([_dummies(cells["participant"].factorize()[0]), _dummies(places)])
    # One column less than pairs: their coefficients add up to 0.
    of_pairs = _dummies(pairs)
    of_pairs = of_pairs[:, :-1] - of_pairs[:, -1:]
    design = np.hstack([of_pairs, beside])
    rank = np.linalg.matrix_rank
    if not of_pairs.size or rank(design) < rank(beside) + of_pairs.shape[1]:
        return movements[measure].astype(float)
    found = np.linalg.lstsq(design, cells[measure].to_numpy(float), rcond=None)[0]
    added = found[: of_pairs.shape[1]]
    adds = dict(zip(kinds, [*added, -added.sum()], strict=True))
    return movements[measure] - movements[pair].map(adds).astype(float)


def _dummies(labels: "np.typing.NDArray[np.integer[Any]]") -> "np.typing.NDArray[np.float64]":
    """Return a column for each label, with 1 in its rows."""
    own: np.typing.NDArray[np.float64] = np.eye(int(labels.max(initial=-1)) + 1)[labels]
    return own


def quantities(movements: "pd.DataFrame", measure: str) -> "pd.DataFrame":
    """Return each participant's :data:`QUANTITIES`, one row per participant, phase and quantity.

    Whoever lacks a first or last position has nothing that goes by it, and whoever lacks a phase
    nothing that goes from it to the next: what stands beside them is no stand-in.

    Parameters
    ----------
    movements
        With the columns ``phase`` (a session or block, in order) and ``place`` (position in it),
        and ``session`` where a session has several phases: only its first has a warm-up decrement
        and retention, against the last phase of the session before. Without it each phase is one.
    """
    import pandas as pd

    own = movements.assign(value=taken_away(movements, measure))
    known = own.dropna(subset=["value"])
    ends = known.groupby("phase")["place"].agg(["min", "max"])
    cells = known.groupby(["participant", "phase", "place"])["value"].mean()
    groups = known.groupby("participant")["group"].first()
    of = "session" if "session" in known else "phase"
    sessions = dict(known.drop_duplicates("phase").set_index("phase", drop=False)[of])
    rows = []
    for participant, mine in cells.groupby(level="participant"):
        before: pd.Series[float] | None = None
        last_before, session_before = np.nan, None
        for phase, (at_first, at_last) in ends.iterrows():
            means = mine[mine.index.get_level_values("phase") == phase].droplevel([0, 1])
            first, last = (float(means.get(place, np.nan)) for place in (at_first, at_last))
            found = {}
            if len(means) > 1:
                found["slope"] = float(np.polyfit(means.index.to_numpy(float), means, 1)[0])
                found["gain"] = last - first
            if before is not None:
                found["change"] = float(means.mean() - before.mean())
            if session_before not in {None, sessions[phase]}:
                found["warm-up decrement"] = first - last_before
                found["retention"] = last - last_before
            about = {"participant": participant, "group": groups[participant], "phase": phase}
            rows += [
                {**about, "quantity": name, "value": value}
                for name, value in found.items()
                if np.isfinite(value)
            ]
            before, last_before, session_before = means, last, sessions[phase]
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
