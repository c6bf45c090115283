"""Columns of the trial table, and their units."""

from labcrane.core.roles import Task

UNITS = {
    "started": "s",
    "ended": "s",
    "seed": "1",
    "paused": "s",
    "late_ticks": "1",
    "worst_lateness": "s",
    "trial": "1",
    "attempt": "1",
    "block": "1",
    "completion": "1",
}
"""Units of the columns that every trial table has."""


def trial_units(task: Task) -> dict[str, str]:
    """Return the unit of every numeric column that ``task`` and the session put into a row."""
    results = {column: signal.unit for signal in task.results for column in signal.columns}
    return {**UNITS, **dict(task.condition_units), **results}
