"""Responses to the stimuli of secondary tasks, timed by when a view or sound presented them."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from labcrane.analysis.cohort import Participant
from labcrane.analysis.presented import operators_views
from labcrane.core.records import is_done
from labcrane.recording.participant_file.reader import SessionRecord
from labcrane.recording.pictures import LOG
from labcrane.types import FloatArray

if TYPE_CHECKING:
    import pandas as pd

STIMULUS, RESPONSE, OUTCOME = "drt.stimulus", "drt.response", "drt.outcome"
"""Events of a detection response task."""

HIT, MISS, CHEAT, HELD, NOT_SHOWN = "hit", "miss", "cheat", "held", "not shown"

ROUNDING_S = 1e-6

MEANING = {
    "secondary": ("", "the protocol's name of the secondary task"),
    "stimulus": ("", "number of the stimulus, from 1, in the process that gave it"),
    "block": ("", "number of the block"),
    "trial": ("", "number of the trial in which its outcome was known"),
    "attempt": ("", "number of the attempt at that trial"),
    "practice": ("", "1 where the block was practice, else 0"),
    "condition": ("", "the condition within participants; empty without one"),
    "counted": ("1", "1 where the trial was done and counts, and 0 in practice as well"),
    "sent": ("s", "when the session switched the stimulus on, on its own clock"),
    "shown": ("s", "when a view or sound had presented it, by its own record; empty without one"),
    "responded": ("s", "the first response before the next stimulus; empty without one"),
    "response_time": ("s", "from shown to responded, or from sent where there is no record"),
    "outcome": (
        "",
        "hit, miss or cheat by that time; held where an interruption ended the stimulus; not shown "
        "where the record of a view or sound has no picture or sound of it",
    ),
}
"""Unit and meaning of the columns of :func:`responses`."""


def responses(session: SessionRecord, display_delay_s: float = 0.0) -> "pd.DataFrame":
    """Return one row per stimulus of a session's detection response tasks.

    Parameters
    ----------
    display_delay_s
        From handing a picture to the screen to its light, in seconds.
    """
    import pandas as pd

    rows = _recorded(session)
    done = _done(session)
    for row in rows:
        _judge(row, session, display_delay_s)
        row["counted"] = float((row["trial"], row["attempt"]) in done)
    return pd.DataFrame(rows, columns=list(MEANING))


def _done(session: SessionRecord) -> set[tuple[int, int]]:
    """Return the trials and attempts that count."""
    found = set()
    events = session.events
    for data in events["data"][events["name"] == "trial.end"]:
        if is_done(data):
            found.add((data["trial"], data["attempt"]))
    return found


def _recorded(session: SessionRecord) -> list[dict[str, Any]]:
    """Return each stimulus as the events have it."""
    rows: list[dict[str, Any]] = []
    under_way: dict[str, dict[str, Any]] = {}
    about: Mapping[str, Any] = {}
    events = session.events
    for name, time, data in zip(events["name"], events["time"], events["data"], strict=True):
        if name == "trial.start":
            about = data
        elif name == "session.start":
            under_way.clear()
        elif name == STIMULUS:
            row = {"outcome": HELD, "sent": time, "feedback": about.get("feedback", "")}
            row |= {key: data[key] for key in ("secondary", "stimulus")} | _of(about)
            under_way[data["secondary"]] = row
            rows.append(row)
        elif name in {RESPONSE, OUTCOME} and data["secondary"] in under_way:
            row = under_way[data["secondary"]]
            if name == RESPONSE:
                row.setdefault("responded", time)
            else:
                row["outcome"] = data["outcome"]
                if row["outcome"] != HELD:  # it is noticed later, perhaps in another block
                    row |= _of(about)
    return rows


def _of(about: Mapping[str, Any]) -> dict[str, Any]:
    found = {key: about.get(key) for key in ("block", "trial", "attempt", "practice")}
    return {**found, "condition": about.get("condition", "")}


def _judge(row: dict[str, Any], session: SessionRecord, display_delay_s: float) -> None:
    """Add when the stimulus was shown, and the outcome that follows."""
    settings = session.context["components"][f"secondary.{row['secondary']}"]["settings"]
    least, most = settings["hit_s"]
    responded = row.setdefault("responded", np.nan)
    until = np.fmin(row["sent"] + settings["longest_s"], responded)
    logs = _logs(session, row)
    shown = [_shown(session, log, row["sent"], until, display_delay_s) for log in logs or ()]
    row["shown"] = float(np.fmin.reduce(shown)) if shown else np.nan
    row["response_time"] = responded - (row["sent"] if logs is None else row["shown"])
    if row["outcome"] == HELD:
        row["response_time"] = np.nan
    elif logs is not None and np.isnan(row["shown"]):
        row["outcome"] = NOT_SHOWN
    elif row["response_time"] < least:
        row["outcome"] = CHEAT
    else:
        row["outcome"] = HIT if row["response_time"] <= most else MISS


def _logs(session: SessionRecord, row: Mapping[str, Any]) -> list[str] | None:
    """Return the streams that record its presentation; None where nothing was presented at all.

    A sound that never started has none, and is not replaced by the pictures of a view.
    """
    components = session.context["components"]
    events = session.events
    told = events["data"][events["name"].isin(["feedback.ready", "feedback.lost"])]
    started = {str(data["what"]) for data in told}
    if not started and not any(name.startswith(LOG) for name in session.streams):
        return None
    names: list[str] = []
    for part, choice in components.items():
        kind, _, name = part.partition(".")
        of = choice.get("settings", {}).get("stimulus")
        on = name in str(row["feedback"]).split("+")
        if kind == "feedback" and on and of == f"{row['secondary']}.stimulus":
            own = name in started or LOG + name in session.streams
            names += [name] if own else operators_views(components)
    return [LOG + name for name in names if LOG + name in session.streams]


def _shown(
    session: SessionRecord, log: str, since: float, until: float, display_delay_s: float
) -> float:
    """Return when the first frame with the stimulus was presented; NaN for never."""
    stream = session.streams[log]
    due = stream.column("frame.due")
    if "shown.tick" in stream.units:  # of a view with a delay, an older frame
        behind = stream.column("frame.tick") - stream.column("shown.tick")
        due = due - behind / float(session.attrs["rate_hz"])
        delay = display_delay_s
    else:
        delay = 0.0
    found = np.flatnonzero((due > since - ROUNDING_S) & (due < until - ROUNDING_S))
    return float(stream.time[found].min()) + delay if len(found) else np.nan


def measured(rows: "pd.DataFrame") -> dict[str, float]:
    """Return the measures of some stimuli: counts, hit rate, mean and median response time.

    The hit rate is that of hits and misses; the response times are those of hits (ISO 17488:2016).
    """
    count = rows["outcome"].value_counts()
    hits, misses = int(count.get(HIT, 0)), int(count.get(MISS, 0))
    times: FloatArray = rows.loc[rows["outcome"] == HIT, "response_time"].to_numpy(float)
    return {
        "hits": hits,
        "misses": misses,
        "cheats": int(count.get(CHEAT, 0)),
        "held": int(count.get(HELD, 0)) + int(count.get(NOT_SHOWN, 0)),
        "hit_rate": hits / (hits + misses) if hits + misses else np.nan,
        "response_time": float(times.mean()) if hits else np.nan,
        "median_response_time": float(np.median(times)) if hits else np.nan,
    }


def measures_by(rows: "pd.DataFrame", by: Sequence[str]) -> "pd.DataFrame":
    """Return the measures of each block, condition or movement, with ``n`` stimuli.

    Only trials that count, as in the report, unless ``by`` has ``practice`` or ``counted``.
    """
    import pandas as pd

    if not {"practice", "counted"} & {*by}:
        rows = rows[rows["counted"] == 1.0]
    keys = ["secondary", *by]
    found: list[dict[str, Any]] = [
        {**dict(zip(keys, key, strict=True)), "n": len(own), **measured(own)}
        for key, own in rows.groupby(keys, sort=False)
    ]
    return pd.DataFrame(found)


def in_trials(trials: "pd.DataFrame", rows: "pd.DataFrame") -> "pd.DataFrame":
    """Return the trial table with the measures of each trial by the record of presentation.

    A session judges by when it sent a stimulus: it cannot know yet when that is shown.
    """
    trials = trials.copy()
    for (secondary, trial, attempt), own in rows.groupby(["secondary", "trial", "attempt"]):
        place = (trials["trial"] == trial) & (trials["attempt"] == attempt)
        for name, value in measured(own).items():
            if (column := f"{secondary}_{name}") in trials:
                trials.loc[place, column] = value
    return trials


def responses_of(participant: Participant) -> "pd.DataFrame":
    """Return one row per stimulus of all sessions of a participant."""
    import pandas as pd

    tables = []
    for number, session in participant.sessions():
        table = responses(session)
        table.insert(0, "participant", participant.name)
        table.insert(1, "status", str(participant.status))
        table.insert(2, "session", number)
        tables.append(table)
    return pd.concat(tables, ignore_index=True)
