"""Columns of the trial table, their units and their definitions."""

from typing import TYPE_CHECKING

from labcrane.core.records import Phase
from labcrane.core.signals import Signal

if TYPE_CHECKING:
    from labcrane.core.roles import Task

ENDS = tuple(str(phase) for phase in Phase if phase.over)

OWN = (
    Signal("started", "s", definition="when the trial began, on the session's clock"),
    Signal("ended", "s", definition="when the trial ended, on the session's clock"),
    Signal("seed", "1", definition="seed of all that is drawn by chance in the trial"),
    Signal("paused", "s", definition="how long the session was paused during the trial"),
    Signal("late_ticks", "1", definition="ticks of the trial that began more than a period late"),
    Signal("worst_lateness", "s", definition="how late the latest tick of the trial began"),
    Signal(
        "trial",
        "1",
        definition="number of the trial in the plan of the session, from 1; what only leads to a "
        "trial has a number too, so that trial 8 of 32 on the screen may be number 10 here",
    ),
    Signal("attempt", "1", definition="number of the attempt at the trial, from 1"),
    Signal("block", "1", definition="number of the block in the session, from 1"),
    Signal("block_name", "", definition="the protocol's name of the block, or else its task's"),
    Signal(
        "practice",
        "1",
        definition="1 where the block was practice, which is in no average, else 0",
    ),
    Signal("group", "", definition="the participant's group of the design"),
    Signal("condition", "", definition="the condition within participants of the design"),
    Signal("track", "", definition="the adaptive track that chose the trial's level"),
    Signal("track_level", "", definition="the level that it chose"),
    Signal("assist", "", definition="the assistant's share that the track chose, by its name"),
    Signal("reference", "1", definition="1 where the trial sets the indicator's reference, else 0"),
    Signal("feedback", "", definition="what was switched on in the trial, joined by +; or none"),
    Signal(
        "track_success",
        "1",
        definition="1 where the trial was a success for its adaptive track, 0 where not; NaN where "
        "it was neither",
    ),
    Signal("outcome", "", definition=f"how the trial ended: {', '.join(ENDS)}"),
    Signal(
        "completion",
        "1",
        definition="the experimenter's flag: 1 where the trial was completed, 0 where not; NaN "
        "where none was set",
    ),
)
"""Columns that a session may put into its trial table."""


def trial_units(task: "Task") -> dict[str, str]:
    """Return the unit of every numeric column that ``task`` and the session put into a row."""
    return {
        column: signal.unit
        for signal in (*OWN, *task.conditions, *task.results)
        for column in signal.columns
        if signal.unit
    }


def trial_definitions(task: "Task") -> dict[str, str]:
    """Return the definition of each column of the session and of ``task``."""
    return {
        column: signal.definition
        for signal in (*OWN, *task.conditions, *task.results)
        for column in signal.columns
        if signal.definition
    }
