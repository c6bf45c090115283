"""Columns of the trial table, their units and their definitions."""

from labcrane.core.roles import Task
from labcrane.core.signals import Signal

OWN = (
    Signal("started", "s", definition="when the trial began, on the session's clock"),
    Signal("ended", "s", definition="when the trial ended, on the session's clock"),
    Signal("seed", "1", definition="seed of all that is drawn by chance in the trial"),
    Signal("paused", "s", definition="how long the session was paused during the trial"),
    Signal("late_ticks", "1", definition="ticks of the trial that began more than a period late"),
    Signal("worst_lateness", "s", definition="how late the latest tick of the trial began"),
    Signal("trial", "1", definition="number of the trial in the session, from 1"),
    Signal("attempt", "1", definition="number of the attempt at the trial, from 1"),
    Signal("block", "1", definition="number of the block in the session, from 1"),
    Signal(
        "completion",
        "1",
        definition="the examiner's flag: 1 where the trial was completed, 0 where not; NaN where "
        "none was set",
    ),
)
"""Columns that every trial table has."""

UNITS = {signal.name: signal.unit for signal in OWN}


def trial_units(task: Task) -> dict[str, str]:
    """Return the unit of every numeric column that ``task`` and the session put into a row."""
    results = {column: signal.unit for signal in task.results for column in signal.columns}
    return {**UNITS, **dict(task.condition_units), **results}


def trial_definitions(task: Task) -> dict[str, str]:
    """Return what is in each column of the session and of the results of ``task``."""
    return {
        column: signal.definition
        for signal in (*OWN, *task.results)
        for column in signal.columns
        if signal.definition
    }
