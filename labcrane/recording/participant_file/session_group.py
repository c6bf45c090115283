"""Group of one session in a participant file, written."""

import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from labcrane.recording.frame_log import LOOP
from labcrane.recording.journal_reader import JournalState, LoggedEvent, SessionLog
from labcrane.recording.participant_file.column_writer import ColumnWriter
from labcrane.recording.participant_file.columns import (
    node_names,
    write_attributes,
    write_numbers,
    write_text,
    write_texts,
    write_values,
)
from labcrane.recording.participant_file.questionnaires import write_questionnaires
from labcrane.recording.trial_columns import OWN
from labcrane.types import FloatArray

if TYPE_CHECKING:
    import h5py

SYNC_REPORT = "sync_report"
TRIAL_END = "trial.end"
COMPLETION_ORDER = "order.completion"
COUNTED = "counted"
"""Only trials whose end says so are results, and rows of the trial table."""


def write_session(group: "h5py.Group", log: SessionLog, journals: Sequence[JournalState]) -> None:
    """Write frames, events, trials and the context of a session into its group."""
    write_tables(group, log, journals)
    _write_frames(group, log)
    for name, values in event_columns(log, group).items():
        if isinstance(values, np.ndarray):
            write_numbers(group, f"events/{name}", values, "s" if name == "time" else "1")
        else:
            write_texts(group, f"events/{name}", values)


def write_tables(group: "h5py.Group", log: SessionLog, journals: Sequence[JournalState]) -> None:
    """Write the context, trials and answers, which follow from a session's events."""
    context = log.context
    write_attributes(group, attributes(context))
    write_text(group, "protocol", str(context.get("protocol", "")))
    write_text(group, "context", json.dumps(dict(context), ensure_ascii=False))
    _write_journals(group.create_group("journals"), journals)
    _write_trials(group.create_group("trials"), log)
    write_questionnaires(group.create_group("questionnaires"), log)


def attributes(context: Mapping[str, Any]) -> dict[str, Any]:
    """Return the attributes from the context: all plain values except long texts."""
    return {
        name: value
        for name, value in context.items()
        if not isinstance(value, dict | list) and name != "protocol"
    }


def _write_journals(group: "h5py.Group", journals: Sequence[JournalState]) -> None:
    """Write which journals this session was built from, so that it is built from them only once."""
    write_texts(group, "name", [journal.name for journal in journals])
    for column in ("size", "samples", "torn", "damaged", "unchecked"):
        values = np.array([getattr(journal, column) for journal in journals], np.float64)
        write_numbers(group, column, values, "1" if column == "samples" else "byte")


def _write_frames(group: "h5py.Group", log: SessionLog) -> None:
    write_numbers(group, "time", log.time, "s")
    write_numbers(group, "part", log.part, "1")
    columns = [
        (f"{column.group}/{column.label.replace('.', '/')}", column.unit) for column in log.columns
    ]
    writer = ColumnWriter(group, columns, len(log.time))
    for block in log.blocks():
        writer.write(block)
    writer.close()
    defined = {f"loop/{each.name}": {"definition": each.definition} for each in LOOP}
    for number, (path, _) in enumerate(columns):
        write_attributes(group[path], {"position": number, **defined.get(path, {})})


def event_columns(
    log: SessionLog, session: "h5py.Group"
) -> Mapping[str, FloatArray | Sequence[str]]:
    """Return the columns of a session's events, whose trials follow from its written frames."""
    events = log.events
    return {
        "time": np.array([event.time for event in events]),
        "tick": np.array([event.tick for event in events]),
        "part": np.array([float(event.part) for event in events]),
        "trial": np.array(_trials_of(log, session)),
        "name": [event.name for event in events],
        "data": [json.dumps(dict(event.data), ensure_ascii=False) for event in events],
    }


def _trials_of(log: SessionLog, session: "h5py.Group") -> list[float]:
    """Return each event's trial: what it says itself, else that of its frame, else NaN."""
    frames: dict[tuple[float, float], float] = {}
    if "loop/tick" in session and "loop/trial" in session:
        tick, trial = session["loop/tick"][:], session["loop/trial"][:]
        wanted = {(float(event.part), event.tick) for event in log.events}
        ticks = np.isin(tick, [number for _, number in wanted])
        frames = dict(
            zip(
                zip(log.part[ticks].tolist(), tick[ticks].tolist(), strict=True),
                trial[ticks].tolist(),
                strict=True,
            )
        )
    return [_own_trial(event, frames.get((event.part, event.tick), np.nan)) for event in log.events]


def _own_trial(event: LoggedEvent, otherwise: float) -> float:
    trial = event.data.get("trial")
    return float(trial) if isinstance(trial, int | float) else otherwise


REPEATED = "repeated"
CUT_OFF = frozenset({REPEATED, "ended", "interrupted"})
"""Outcomes of attempts that are never a result."""


def _trial_rows(log: SessionLog) -> list[Mapping[str, Any]]:
    """Return the end of every counted attempt; of two attempts only the later one has a result.

    An attempt that was over and was run again with its block becomes ``repeated``: what it was at
    first is in the events.
    """
    begun = [event.data for event in log.events if event.name == "trial.start"]
    last: dict[Any, int] = {}
    for data in begun:
        last[data.get("trial")] = max(last.get(data.get("trial"), 1), data.get("attempt", 1))
    rows = []
    set_after = _set_after(log)
    for event in log.events:
        data = event.data
        if event.name != TRIAL_END or data.get(COUNTED) is not True:
            continue
        redone = data.get("attempt", 1) < last.get(data.get("trial"), 1)
        if redone and data.get("outcome") not in CUT_OFF:
            data = {**data, "outcome": REPEATED}
        if (late := set_after.get((data.get("trial"), data.get("attempt")))) is not None:
            data = {**data, "completion": late}
        rows.append(data)
    return rows


def _set_after(log: SessionLog) -> dict[tuple[object, object], int]:
    """Return completion flags that were set after a trial had ended, by trial and attempt.

    The experimenter sets them. The row that the trial ended with stays unchanged in the events.
    """
    return {
        (event.data.get("trial"), event.data.get("attempt")): int(event.data["text"])
        for event in log.events
        if event.name == COMPLETION_ORDER
        and event.data.get("after")
        and event.data.get("refused") is None
    }


def _write_trials(group: "h5py.Group", log: SessionLog) -> None:
    rows = _trial_rows(log)
    units = log.context.get("trial_units", {})
    own = {each.name: each.definition for each in OWN}
    definitions = {**own, **log.context.get("trial_definitions", {})}
    columns = list(dict.fromkeys(name for row in rows for name in row if name != COUNTED))
    for number, (name, safe) in enumerate(node_names(columns)):
        write_values(group, safe, [row.get(name) for row in rows], units.get(name))
        about = {"definition": definitions[name]} if name in definitions else {}
        write_attributes(group[safe], {"name": name, "position": number, **about})


def write_sync_report(group: "h5py.Group", report: Mapping[str, Any]) -> None:
    """Write a session's sync report into its group, in place of an earlier one."""
    if SYNC_REPORT in group:
        del group[SYNC_REPORT]
    write_text(group, SYNC_REPORT, json.dumps(report, ensure_ascii=False, allow_nan=False))
