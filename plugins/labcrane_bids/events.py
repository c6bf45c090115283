"""Events: what happened, in seconds from the first sample, with HED tags."""

from typing import TYPE_CHECKING, Any

from labcrane.analysis import events_of, movements_of
from labcrane.recording import SessionRecord, hed_sidecar, labelled, name_of
from labcrane_bids.files import first_tick

if TYPE_CHECKING:
    import pandas as pd

REPEAT = "repeat"
"""Tells apart events of one name at one moment: HED joins the tags of a moment, and refuses what is
said twice."""

MARK = "annotation"
"""What somebody marked afterwards: a row of that type, and a column of its text where there is
any."""

COLUMNS = ("trial", "attempt", "block", "outcome", "pair", "direction")
"""What of an event's data becomes a column of its own."""


def event_table(session: SessionRecord) -> "pd.DataFrame":
    """Return the events: onset, duration, trial_type, label, and what trial they are of.

    ``trial_type`` is the event's plain name and ``label`` says block and condition too. A trial's
    start lasts until its end; everything else is a moment. ``response_time`` is the reaction
    time: from the trial's start to the first stick beyond its dead zone. What somebody marked
    afterwards is an ``annotation`` with its text.
    """
    import pandas as pd

    zero = first_tick(session)
    events = events_of(session).sort_values("time", kind="stable")
    rows_of = (movement.row for movement in movements_of(session))
    ended = {(row["trial"], row["attempt"]): row for row in rows_of}
    rows = []
    told = list(zip(events["name"].astype(str), events["data"], strict=True))
    for time, (name, data), label in zip(events["time"], told, labelled(told), strict=True):
        key = (data.get("trial"), data.get("attempt"))
        row = ended.get(key) if name == "trial.start" else None
        rows.append(
            {
                "onset": time - zero,
                "duration": 0.0 if row is None else row["ended"] - time,
                "trial_type": name_of(name),
                "label": label,
                "response_time": None if row is None else row.get("reaction_time"),
            }
            | {column: data.get(column) for column in COLUMNS}
        )
    marks = session.annotations
    rows += [
        {"onset": time - zero, "duration": until - time, "trial_type": MARK, "label": MARK,
         MARK: " ".join(text.split())}
        for time, until, text in zip(marks["time"], marks["until"], marks["text"], strict=True)
    ]  # fmt: skip
    table = pd.DataFrame(rows).sort_values("onset", kind="stable", ignore_index=True)
    again = table.groupby(["onset", "trial_type"]).cumcount() + 1
    table[REPEAT] = again.where(again > 1)
    for name in ("trial", "attempt", "block", REPEAT):
        table[name] = table[name].astype("Int64")
    return table


def event_description(table: "pd.DataFrame", context: dict[str, Any]) -> dict[str, Any]:
    """Return the sidecar: every column, and the levels of trial_type with their HED tags."""
    types = hed_sidecar(table["trial_type"])
    hed = {name: f"{tags.removesuffix(')')}, {{{REPEAT}}})" for name, tags in types["HED"].items()}
    marked = {MARK: {"Description": "what somebody wrote into the recording afterwards"}}
    return {
        **(marked if MARK in table else {}),
        "onset": {"Description": "from the first sample of motion", "Units": "s"},
        "duration": {"Description": "of a trial; 0 for a moment", "Units": "s"},
        "trial_type": {**types, "HED": hed},
        "label": {"Description": "name of the event, block and condition"},
        "response_time": {
            "Description": "from the trial's start to the first stick beyond its dead zone",
            "Units": "s",
        },
        "trial": {"Description": "number of the trial in the session"},
        "attempt": {"Description": "counts from 1; more when the trial was repeated"},
        "block": {"Description": "number of the block in the session"},
        "outcome": {"Description": "how the trial ended"},
        "pair": {"Description": "pair of targets"},
        "direction": {"Description": "away from the machine's base, or towards it"},
        REPEAT: {
            "Description": "counts events of one name at one moment from 2; n/a for the first",
            "HED": "Parameter-value/#",
        },
        "StimulusPresentation": {
            "OperatingSystem": str(context.get("versions", {}).get("system", "n/a")),
            "SoftwareName": "labcrane",
            "SoftwareVersion": str(context.get("versions", {}).get("labcrane", "n/a")),
            "Code": "n/a",
        },
    }
