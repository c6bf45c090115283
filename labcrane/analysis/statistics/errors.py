"""Errors of aimed movements, by participant."""

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import pandas as pd

CONDITION = ("session", "block", "distance", "far_side", "direction")
"""Columns that define a condition, if present."""


def errors(results: "pd.DataFrame") -> "pd.DataFrame":
    """Return the errors of each participant, one row each, in m.

    ``constant_error_m`` is the mean signed error along the task axis, and
    ``absolute_error_along_m`` the mean of its size. ``variable_error_m`` is the spread of
    movements of one condition about their mean along the axis (Schmidt & Lee 2011, Motor Control
    and Learning): the root of the conditions' variances, averaged by their degrees of freedom; NaN
    where no condition has two movements. ``radial_error_m`` is the mean distance from the target's
    centre, in any direction, which is the measure ``absolute_error``.
    """
    by_person = results.groupby("participant")
    condition = ["participant", *(name for name in CONDITION if name in results)]
    error = results["constant_error"]
    cells = error.groupby([results[name] for name in condition], dropna=False)
    beside = (error - cells.transform("mean")) ** 2
    freedom = cells.count().sub(1).clip(lower=0).groupby("participant").sum()
    variance = beside.groupby(results["participant"]).sum() / freedom.where(freedom > 0)
    found = by_person.agg(
        movements=("trial", "size"),
        movement_time_s=("movement_time", "mean"),
        constant_error_m=("constant_error", "mean"),
    )
    found["variable_error_m"] = np.sqrt(variance)
    found["absolute_error_along_m"] = error.abs().groupby(results["participant"]).mean()
    found["radial_error_m"] = by_person["absolute_error"].mean()
    return found.reset_index()
