"""Episodes of a recording: one per counted attempt, as pairs of observation and action.

A row has the state of one tick and the axes of the next: a policy trained on frames would learn to
read axes from their consequence.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from labcrane import RecordingError
from labcrane.analysis import Participant, presentation_failed
from labcrane.recording import SessionRecord, Stream, attempt_of

if TYPE_CHECKING:
    pass

ROUNDING_S = 1e-9
SHORTEST = 2
"""Ticks of which one pair of seen and done can be made."""

DONE = ("input",)
SEEN = ("state", "task")
"""Groups of columns that are an action, and those that are an observation."""

Names = tuple[str, ...]
Table = npt.NDArray[np.float32]


@dataclass(frozen=True)
class Episode:
    """One attempt at one trial, pauses left out.

    Row ``k`` holds what was seen in one tick, and what the operator did upon it: the axes of the
    next tick, of which the next row's state comes.

    Attributes
    ----------
    participant, session, trial, attempt
        Whose, and which.
    task
        What was to be done, in words.
    success
        Whether it was, by an operator who was shown enough of it.
    presentation_failed
        Whether less was presented to the operator than the protocol specifies; the attempt is then
        not a success, whatever its outcome.
    skill
        Fraction of the operator's attempts in this recording that succeeded, of those of which
        enough was shown.
    rate_hz
        Rows per second.
    observation, action
        Shapes ``(n, n_observations)`` and ``(n, n_actions)``, in float32.
    ticks
        Of the session, in which each row was seen, shape ``(n,)``.
    """

    participant: str
    session: int
    trial: int
    attempt: int
    task: str
    success: bool
    presentation_failed: bool
    skill: float
    rate_hz: float
    observation: Table
    action: Table
    ticks: npt.NDArray[np.int64]


@dataclass(frozen=True)
class EpisodeLayout:
    """What the columns of all episodes are, which must be the same for everybody.

    Attributes
    ----------
    observation, action
        Names of the columns: ``state.joint.angle.slew``, ``input.left.x``.
    units
        Of each name.
    """

    observation: Names
    action: Names
    units: Mapping[str, str]


def layout_of(session: SessionRecord) -> EpisodeLayout:
    """Return the columns of a session's episodes."""
    units = {
        f"{group}.{name}": unit
        for group in (*SEEN, *DONE)
        if group in session.streams
        for name, unit in session.streams[group].units.items()
    }
    seen = tuple(name for name in units if name.partition(".")[0] in SEEN)
    return EpisodeLayout(seen, tuple(name for name in units if name not in seen), units)


def episodes_of(
    participant: Participant, layout: EpisodeLayout, words: str, every: int = 1
) -> Iterator[Episode]:
    """Yield a participant's episodes, in order, with every so manieth row; one in memory at a time.

    Raises
    ------
    RecordingError
        A session has other columns than ``layout``.
    """
    sessions = list(participant.sessions())
    failed = {number: presentation_failed(session) for number, session in sessions}
    ends = [
        str(row.get("outcome"))
        for number, session in sessions
        for row in session.trials.to_dict("records")
        if not failed[number].get(attempt_of(row))
    ]
    skill = ends.count("success") / len(ends) if ends else float("nan")
    for number, session in sessions:
        if layout_of(session) != layout:
            raise RecordingError(
                f"session {number} of {participant.name} has other columns than the sessions "
                "before it, and one data set has the same for all; export those with other "
                "columns by themselves"
            )
        title = words or str(session.context.get("title", ""))
        for row in session.trials.to_dict("records"):
            rows = _rows(session, row)
            if len(rows) < SHORTEST:
                continue
            seen, done = (
                _read(session, layout.observation, rows),
                _read(session, layout.action, rows),
            )
            unseen = failed[number].get(attempt_of(row), False)
            yield Episode(
                participant=participant.name,
                session=number,
                trial=int(row["trial"]),
                attempt=int(row.get("attempt", 1)),
                task=_task(title, row),
                success=str(row.get("outcome")) == "success" and not unseen,
                presentation_failed=unseen,
                skill=skill,
                rate_hz=float(session.attrs["rate_hz"]) / every,
                observation=seen[:-1:every],
                action=done[1::every],
                ticks=rows[:-1:every],
            )


def ticks_of(session: SessionRecord, every: int) -> npt.NDArray[np.int64]:
    """Return the ticks of all rows of a session's episodes, in order."""
    found = [_rows(session, row) for row in session.trials.to_dict("records")]
    rows = [each[:-1:every] for each in found if len(each) >= SHORTEST]
    return np.unique(np.concatenate(rows)) if rows else np.empty(0, np.int64)


def _rows(session: SessionRecord, row: Mapping[Any, Any]) -> npt.NDArray[np.int64]:
    """Return the ticks of an attempt outside pauses."""
    loop = session.streams["loop"]
    due = loop.time
    first, last = np.searchsorted(
        due, [float(str(row["started"])) - ROUNDING_S, float(str(row["ended"])) + ROUNDING_S]
    )
    inside = loop.column("trial", first, last) == row["trial"]
    inside &= loop.column("paused", first, last) == 0.0
    return np.asarray(first + np.flatnonzero(inside))


def _read(session: SessionRecord, names: Names, rows: npt.NDArray[np.int64]) -> Table:
    """Return columns of some ticks; only the stretch that they are in is read."""
    first, last = int(rows[0]), int(rows[-1]) + 1
    table = np.empty((len(rows), len(names)), np.float32)
    for number, name in enumerate(names):
        group, _, label = name.partition(".")
        stream: Stream = session.streams[group]
        table[:, number] = stream.column(label, first, last)[rows - first]
    return table


ASIDE = {"outcome", "block_name", "group", "feedback"}
"""Columns of a trial's row that do not describe the task."""


def _task(title: str, row: Mapping[Any, Any]) -> str:
    """Return the description of the task: the study's words, and those of the trial's condition."""
    words = [
        f"{name.replace('_', ' ')} {value}"
        for name, value in row.items()
        if isinstance(value, str) and value and name not in ASIDE
    ]
    return ": ".join(filter(None, (title, ", ".join(words))))
