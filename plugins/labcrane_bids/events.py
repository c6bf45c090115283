"""Events: what happened, in seconds from the first sample, with HED tags."""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from labcrane.analysis import PRESENTED, glass_of, presentation_failed
from labcrane.core import name_of
from labcrane.recording import (
    SessionRecord,
    attempt_of,
    hed_sidecar,
    labelled,
    void_attempts,
)
from labcrane_bids.files import first_tick

if TYPE_CHECKING:
    import pandas as pd

REPEAT = "repeat"
"""Number that distinguishes events with the same name and time: HED joins the tags of one time, and
rejects duplicates."""

END = "trial.end"
FAILED = "presentation_failed"

MARK, CODER = "annotation", "coder"
NOTED = ("time", "until", "text", CODER)
"""An annotation that was added after the recording: a row of that type, and a column with its text
if there is any."""

FILM = "film"
FILMED: Mapping[str, dict[str, str]] = {
    "file": {"Description": "name of the film's file, which is not in this dataset"},
    "rate_hz": {"Description": "its frames per second", "Units": "Hz"},
    "frames": {"Description": "its number of frames"},
    "dropped": {"Description": "frames that were dropped"},
    "time_error": {"Description": "uncertainty of 95 % of its frames' times", "Units": "s"},
}
"""What is known of a film, which is a row of the type ``film``."""

OWN: Mapping[str, dict[str, str]] = {
    "onset": {"Description": "from the first sample of motion", "Units": "s"},
    "duration": {
        "Description": "of a trial; n/a if its end is unknown; 0 for a momentary event",
        "Units": "s",
    },
    "label": {"Description": "name of the event, block and condition"},
    "response_time": {
        "Description": "from the trial's start to the first stick beyond its dead zone",
        "Units": "s",
    },
    "void": {"Description": "1 in an attempt that was aborted, or repeated later"},
    FAILED: {"Description": PRESENTED[FAILED][1]},
    "counted": {"Description": "1 in a trial that is analysed; 0 in an approach movement"},
    REPEAT: {
        "Description": "number among events with the same name and time, from 2; n/a for the first",
        "HED": "Parameter-value/#",
    },
}
"""Columns of this table. Those of the trial are defined by the recording."""


def event_table(session: SessionRecord) -> "pd.DataFrame":
    """Return the events: onset, duration, trial_type, label, and their trial.

    ``trial_type`` is the event's plain name; ``label`` also contains block and condition. A trial's
    start lasts until the trial's end, which is unknown if the process died; all other events are
    momentary. Each event of a trial has the items of the trial's start, such as its condition;
    a name that this table has itself is preceded by ``trial_``. ``presentation_failed`` is n/a for
    events outside the trial table, and if nothing was to be shown. ``response_time`` is the
    reaction time: from the trial's start to the first stick beyond its dead zone. Annotations that
    were added after the recording have the type ``annotation`` and their text, and films the type
    ``film``.
    """
    import pandas as pd

    zero = first_tick(session)
    events = session.events.sort_values("time", kind="stable")
    told = list(zip(events["name"].astype(str), events["data"], strict=True))
    void, failed = void_attempts(told), presentation_failed(session)
    ended = {attempt_of(data): data for name, data in told if name == END}
    rows = []
    begun: dict[object, Mapping[str, Any]] = {}
    taken = {"trial_type", *OWN, MARK, CODER, *(f"{FILM}_{fact}" for fact in FILMED)} - {"counted"}
    columns = _of_trials(told)
    for time, (name, data), label in zip(events["time"], told, labelled(told, failed), strict=True):
        row: Mapping[str, Any] = {}
        if name == "trial.start":
            begun[data["trial"]] = data
            row = ended.get(attempt_of(data), {"ended": math.nan})
        said = {key: data[key] for key in ("attempt", "outcome") if key in data}
        about = {**data, **begun.get(data.get("trial"), {}), **said}
        rows.append(
            {
                "onset": time - zero,
                "duration": row.get("ended", math.nan) - time if row else 0.0,
                "trial_type": name_of(name),
                "label": label,
                "response_time": row.get("reaction_time"),
                "void": attempt_of(about) in void if "attempt" in about else None,
                FAILED: failed.get(attempt_of(about)),
            }
            | {
                f"trial_{column}" if column in taken else column: about.get(column)
                for column in columns
            }
        )
    marks = session.annotations
    rows += [
        {"onset": time - zero, "duration": until - time, "trial_type": MARK, "label": MARK,
         MARK: " ".join(text.split()), CODER: coder or None}
        for time, until, text, coder in zip(*(marks[name] for name in NOTED), strict=True)
    ]  # fmt: skip
    rows += [
        {"onset": row["time"] - zero, "duration": row["until"] - row["time"], "trial_type": FILM,
         "label": f"film {row['recording']}",
         **{f"{FILM}_{fact}": row[fact] for fact in FILMED}}
        for film in session.films.values()
        for row in film.listed()
    ]  # fmt: skip
    table = pd.DataFrame(rows).sort_values("onset", kind="stable", ignore_index=True)
    again = table.groupby(["onset", "trial_type"]).cumcount() + 1
    table[REPEAT] = again.where(again > 1)
    table = table.convert_dtypes()
    flags = table.select_dtypes("boolean")
    table[flags.columns] = flags.astype("Int64")
    return table


def _of_trials(told: Sequence[tuple[str, Mapping[str, Any]]]) -> dict[str, None]:
    """Return what trials are described by: the items of their starts, and their outcome."""
    starts = (data for name, data in told if name == "trial.start")
    return dict.fromkeys((*(key for data in starts for key in data), "outcome"))


def screen_of(session: SessionRecord) -> dict[str, Any]:
    """Return the known properties of the operator's picture in BIDS form; n/a means no screen.

    The window represents the screen: gaze is in its pixels, from its upper left corner.
    """
    glass = glass_of(session)
    if glass is None:
        return {"ScreenOrigin": ["top", "left"]}
    told: dict[str, Any] = {
        "ScreenDistance": glass.viewing_m,
        "ScreenRefreshRate": glass.refresh_hz,
        "ScreenSize": [side / glass.px_per_m for side in glass.size],
    }
    return {
        "ScreenOrigin": ["top", "left"],
        "ScreenResolution": list(glass.size),
        **{name: value for name, value in told.items() if np.isfinite(value).all()},
    }


def event_description(
    table: "pd.DataFrame", context: dict[str, Any], screen: Mapping[str, Any]
) -> dict[str, Any]:
    """Return the sidecar: every column, and the levels of trial_type with their HED tags.

    ``screen`` is what is known of the screen (:func:`screen_of`).
    """
    types = hed_sidecar(table["trial_type"])
    hed = {name: f"{tags.removesuffix(')')}, {{{REPEAT}}})" for name, tags in types["HED"].items()}
    marked = {
        MARK: {"Description": "text of an annotation that was added after the recording"},
        CODER: {"Description": "who added it"},
    }
    films = {f"{FILM}_{fact}": said for fact, said in FILMED.items()}
    known = {**OWN, **marked, **films, "trial_type": {**types, "HED": hed}}
    return {
        **{name: known.get(name) or _of_trial(name, context) for name in map(str, table)},
        "StimulusPresentation": {
            "OperatingSystem": str(context.get("versions", {}).get("system", "n/a")),
            "SoftwareName": "labcrane",
            "SoftwareVersion": str(context.get("versions", {}).get("labcrane", "n/a")),
            "Code": "n/a",
            **screen,
        },
    }


def _of_trial(column: str, context: Mapping[str, Any]) -> dict[str, str]:
    """Return the recording's description of a column of its trial table."""
    meanings = context.get("trial_definitions", {})
    name = column if column in meanings else column.removeprefix("trial_")
    said = {
        "Description": meanings.get(name) or name.replace("_", " "),
        "Units": context.get("trial_units", {}).get(name, ""),
    }
    return {key: text for key, text in said.items() if text not in {"", "1"}}
