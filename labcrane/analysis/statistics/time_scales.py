"""Change within sessions or blocks, and from one to the next.

Named as motor learning names them: the difference score is what a retention interval costs, from
the end of practice to the first position after it (Schmidt & Lee 2011). It is a warm-up decrement
only as far as it is made good at once, which no single position can tell.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from labcrane.analysis.statistics.confounding import dummies
from labcrane.analysis.statistics.rounding import alike, without_rounding
from labcrane.analysis.statistics.trends import LEAST
from labcrane.types import FloatArray

if TYPE_CHECKING:
    import pandas as pd

QUANTITIES = {
    "slope": "change per position within it, least squares",
    "gain": "its last position minus its first",
    "change": "its mean minus that of the one before",
    "difference score": "its first position minus the last of the session before",
    "net gain": "its last position minus the last of the session before",
}
"""What is worked out of each participant's session or block."""

FROM_BEFORE = ("change", "difference score", "net gain")
"""Those that go from one session or block to the next."""


TAKEN = "pairs' means taken away"
"""An adjustment that was made: what pairs of targets add is taken away."""

APART = "positions cannot be distinguished from pairs of targets"
"""Why one could not be made."""

LEAST_SHARE = 1e-9
"""Of a pair in a quantity; what is below it comes of rounding."""


@dataclass(frozen=True, slots=True)
class Adjustment:
    """What each pair of targets adds to a measure, and what of it is known.

    Attributes
    ----------
    shares
        Sum-to-zero columns of pairs, one row per movement; none where there is one pair or none.
    adds
        What each column adds, in the measure's unit, shape ``(columns,)``.
    known
        Projects upon the combinations of columns that can be told from positions and people, shape
        ``(columns, columns)``.
    """

    shares: "pd.DataFrame"
    adds: FloatArray
    known: FloatArray

    def taken_from(self, seen: FloatArray) -> tuple[float, str]:
        """Return a quantity without what pairs add to it, and which adjustment that was.

        It is :data:`TAKEN`, or empty where pairs add nothing to this quantity; where it cannot be
        made it is :data:`APART`, and the quantity NaN.

        Parameters
        ----------
        seen
            The quantity of the measure, and that of each column of shares.
        """
        value, shares = float(seen[0]), seen[1:]
        if not np.any(np.abs(shares) > LEAST_SHARE):
            return value, ""
        if np.any(np.abs(shares - shares @ self.known) > LEAST_SHARE):
            return np.nan, APART
        return value - float(shares @ self.adds), TAKEN


def adjustment(movements: "pd.DataFrame", measure: str) -> Adjustment:
    """Return what each pair of targets adds.

    Positions can then be compared though pairs come in another order for everybody. What a pair
    adds is its coefficient in least squares beside participant and position (in each phase), over
    their cells' means, and is 0 on average over pairs: means of pairs alone would take learning
    away with them wherever a pair came late more often than others. Pairs that cannot be told from
    positions and people, as when they come in one order for all, stay unknown.

    Parameters
    ----------
    movements
        With ``participant``, ``pair`` or ``distance``, and where there are some ``phase`` and
        ``place``.
    """
    import pandas as pd

    pair = next((name for name in ("pair", "distance") if name in movements), None)
    if pair is None:
        return Adjustment(pd.DataFrame(index=movements.index), np.empty(0), np.empty((0, 0)))
    where = [name for name in ("phase", "place") if name in movements]
    cells = movements.groupby(["participant", *where, pair])[measure].mean().dropna().reset_index()
    places = cells.groupby(where).ngroup().to_numpy() if where else np.zeros(len(cells), int)
    kinds = sorted(cells[pair].unique())
    beside = np.hstack([dummies(cells["participant"].factorize()[0]), dummies(places)])
    of_pairs = _shares(cells[pair], kinds).to_numpy(float)
    both = np.column_stack([of_pairs, cells[measure].to_numpy(float)])
    left = both - beside @ np.linalg.lstsq(beside, both, rcond=None)[0]
    left, rest = left[:, :-1], left[:, -1]
    left[np.abs(left) < LEAST_SHARE] = 0.0
    inverse = np.linalg.pinv(left, rcond=LEAST_SHARE)
    return Adjustment(_shares(movements[pair], kinds), inverse @ rest, inverse @ left)


def _shares(pairs: "pd.Series[Any]", kinds: "Sequence[Any]") -> "pd.DataFrame":
    """Return sum-to-zero columns of pairs: one less than pairs, whose coefficients add up to 0."""
    import pandas as pd

    own = {kind: (pairs == kind).astype(float) for kind in kinds}
    columns = {f"share {at}": own[kind] - own[kinds[-1]] for at, kind in enumerate(kinds[:-1])}
    return pd.DataFrame(columns, index=pairs.index)


def quantities(movements: "pd.DataFrame", measure: str) -> "pd.DataFrame":
    """Return each participant's :data:`QUANTITIES`, one row per participant, phase and quantity.

    Values are adjusted for pairs of targets, and ``adjustment`` states whether they were. A
    participant without a first or last position has no quantity that needs it, and one without a
    phase has none from that phase to the next: neighbours are not substituted.

    Parameters
    ----------
    movements
        With the columns ``phase`` (a session or block, in order) and ``place`` (position in it),
        and ``session`` where a session has several phases: only its first has a difference score
        and a net gain, against the last phase of the session before. Without it each phase is one.
    """
    import pandas as pd

    of_pairs = adjustment(movements, measure)
    own = movements.assign(value=movements[measure].astype(float), **of_pairs.shares)
    known = own.dropna(subset=["value"])
    ends = known.groupby("phase")["place"].agg(["min", "max"])
    # Whatever is worked out of the measure is worked out of pairs' shares as well.
    cells = known.groupby(["participant", "phase", "place"])[["value", *of_pairs.shares]].mean()
    of_group = dict(zip(known["participant"], known["group"], strict=True))
    of = "session" if "session" in known else "phase"
    sessions = dict(known.drop_duplicates("phase").set_index("phase", drop=False)[of])
    nothing = np.full(cells.shape[1], np.nan)
    rows = []
    for participant, mine in cells.groupby(level="participant"):
        before: FloatArray | None = None
        last_before, session_before = nothing, None
        for phase, at_first, at_last in ends.itertuples():
            means = mine[mine.index.get_level_values("phase") == phase].droplevel([0, 1])
            first, last = (
                means.loc[place].to_numpy(float) if place in means.index else nothing
                for place in (at_first, at_last)
            )
            found = {}
            if len(means) > 1:
                places = means.index.to_numpy(float)
                found["slope"] = np.polyfit(places, means.to_numpy(float), 1)[0]
                found["gain"] = last - first
            mean = means.to_numpy(float).mean(axis=0) if len(means) else nothing
            if before is not None:
                found["change"] = mean - before
            if session_before not in {None, sessions[phase]}:
                found["difference score"] = first - last_before
                found["net gain"] = last - last_before
            about = {"participant": participant, "group": of_group[participant], "phase": phase}
            for name, seen in found.items():
                if np.isfinite(seen[0]):
                    value, word = of_pairs.taken_from(seen)
                    rows.append({**about, "quantity": name, "value": value, "adjustment": word})
            before, last_before, session_before = mean, last, sessions[phase]
    names = ["participant", "group", "phase", "quantity", "value", "adjustment"]
    table = pd.DataFrame(rows, columns=names)
    values = without_rounding(table["value"].to_numpy(float), known["value"].to_numpy(float))
    return table.assign(value=values)


def adjusted(found: "pd.DataFrame") -> str:
    """Return the adjustment of a quantity over participants; one that lacks it spoils the mean."""
    words = set(found["adjustment"])
    return APART if APART in words else TAKEN if TAKEN in words else ""


def summary(found: "pd.DataFrame", measure: str, people: Mapping[str, str]) -> "pd.DataFrame":
    """Return mean, confidence interval and t test against zero of each, for all and by group.

    ``why`` says what a row without a test lacks, ``left_out`` who has no such quantity.

    Parameters
    ----------
    found
        Of :func:`quantities`.
    people
        Everybody in the sample, and their group.
    """
    import pandas as pd
    from scipy.stats import ttest_1samp

    rows = []
    everybody = {"all": list(people)}
    if len(groups := sorted({name for name in people.values() if name})) > 1:
        everybody |= {group: [who for who in people if people[who] == group] for group in groups}
    for (phase, quantity), part in found.groupby(["phase", "quantity"], sort=False):
        word = adjusted(part)
        for group, who in everybody.items():
            mine = part[part["participant"].isin(who)]
            values = mine["value"].to_numpy(float)
            gone = [name for name in who if name not in set(mine["participant"])]
            why = ""
            if word == APART:
                why = APART
            elif len(values) < LEAST:
                why = f"{len(values)} of {len(who)} people have it, and {LEAST} are needed"
            elif alike(values):
                why = "all have the same"
            row = {"measure": measure, "phase": phase, "quantity": quantity, "group": group}
            row |= {"adjustment": word, "n": len(values), "left_out": " ".join(gone), "why": why}
            if word != APART and len(values):
                row["mean"] = float(values.mean())
            if not why:
                test = ttest_1samp(values, 0.0)
                low, high = test.confidence_interval(0.95)
                row |= {"ci_low": float(low), "ci_high": float(high), "t": float(test.statistic)}
                row |= {"df": float(test.df), "p": float(test.pvalue)}
            rows.append(row)
    names = ["measure", "phase", "quantity", "group", "adjustment", "n", "mean"]
    names += ["ci_low", "ci_high", "t", "df", "p", "left_out", "why"]
    return pd.DataFrame(rows).reindex(columns=names)
