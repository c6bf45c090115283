"""Time-outs: their counts, and medians in which they are censored."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from labcrane.analysis.presented import not_presented
from labcrane.analysis.quality import is_success
from labcrane.core.records import UNDONE
from labcrane.types import FloatArray

if TYPE_CHECKING:
    import pandas as pd

SAME = 1e-9
HALF = 0.5


def median_time(seconds: FloatArray, finished: FloatArray) -> float:
    """Return the time by which half is finished, after Kaplan and Meier; NaN if fewer are.

    Unfinished trials are only known to take longer: a mean of finished ones makes a
    hard condition look fast (Kaplan & Meier 1958, JASA 53:457-481). Where exactly half is
    finished between two times, their middle is returned, as R's ``survival`` does.

    Parameters
    ----------
    seconds
        Time until it was finished or given up, shape ``(n,)``.
    finished
        Whether it was finished, shape ``(n,)``.
    """
    from statsmodels.duration.survfunc import SurvfuncRight

    if not np.any(finished):
        return float("nan")
    curve = SurvfuncRight(seconds, np.asarray(finished, float))
    times, left = curve.surv_times, curve.surv_prob
    below = np.flatnonzero(left <= HALF + SAME)
    if not below.size:
        return float("nan")
    first = int(below[0])
    if abs(left[first] - HALF) > SAME:
        return float(times[first])
    later = times[first + 1 :][left[first + 1 :] < HALF - SAME]
    return float((times[first] + later[0]) / 2.0) if later.size else float(times[first])


def time_outs(movements: "pd.DataFrame", by: Sequence[str]) -> "pd.DataFrame":
    """Return for each condition the numbers of finished and unfinished trials, and their times.

    There is at least one column to go ``by``. ``seconds`` count from the trial's start, pauses left
    out. Practice, attempts that are not the trial's last and what was not shown are not in it;
    skipped trials are counted as neither, and so are successes in which nothing moved.
    """
    import pandas as pd

    own = movements[(movements["practice"].astype(float) == 0.0)].copy()
    own = own[~own["outcome"].isin(UNDONE) & ~not_presented(own)]
    own["seconds"] = trial_seconds(own)
    rows = []
    for level, part in own.groupby(list(by)):
        done, out = is_success(part), part["outcome"] == "timeout"
        judged = part[done | out]
        rows.append(
            {
                **dict(zip(by, level, strict=True)),
                "trials": len(part),
                "successes": int(done.sum()),
                "time_outs": int(out.sum()),
                "others": int((~done & ~out).sum()),
                "time_out_share": float(out.sum() / len(judged)) if len(judged) else np.nan,
                "mean_of_successes_s": float(part.loc[done, "seconds"].mean()),
                "median_with_time_outs_s": median_time(
                    judged["seconds"].to_numpy(float),
                    np.asarray(is_success(judged), np.float64),
                ),
            }
        )
    return pd.DataFrame(rows)


def trial_seconds(movements: "pd.DataFrame") -> "pd.Series[float]":
    """Return how long each trial took, from its start to its offset or its end."""
    whole = movements["ended"] - movements["started"]
    if "paused" in movements:
        whole = whole - movements["paused"].fillna(0.0)
    if "movement_time" in movements and "movement_onset" in movements:
        offset = movements["movement_onset"] + movements["movement_time"]
        return offset.where(movements["outcome"] == "success").fillna(whole)
    return whole
