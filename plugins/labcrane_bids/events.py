"""Events: what happened, in seconds from the first sample, with HED tags."""

from typing import TYPE_CHECKING, Any

from labcrane.recording import SessionRecord

if TYPE_CHECKING:
    import pandas as pd

HED_VERSION = "8.3.0"

TAGS = {
    "session.start": "(Experiment-structure, Label/session-start)",
    "session.end": "(Experiment-structure, Label/session-end)",
    "block.start": "(Experiment-structure, Label/block-start)",
    "block.end": "(Experiment-structure, Label/block-end)",
    "trial.start": "(Experiment-structure, Label/trial-start)",
    "trial.end": "(Experiment-structure, Label/trial-end)",
    "targets.shown": "(Sensory-event, Visual-presentation, (Target, Circle), Label/targets-shown)",
    "command.onset": "(Agent-action, Participant-response, (Move, Hand), Label/command-onset)",
    "movement.onset": "(Agent-action, (Move, Machine), Label/movement-onset)",
    "target.entered": "(Measurement-event, (Target, Circle), Label/target-entered)",
    "movement.offset": "(Agent-action, (Move, Machine), Label/movement-offset)",
    "pause.start": "(Experiment-control, Label/pause-start)",
    "pause.end": "(Experiment-control, Label/pause-end)",
    "break.start": "(Experiment-structure, Label/break-start)",
    "break.end": "(Experiment-structure, Label/break-end)",
    "instructions.shown": "(Sensory-event, Instructional, Label/instructions-shown)",
}
"""What each event is, in Hierarchical Event Descriptors; events of others have none.

Each in brackets with a label of its own: tags at the same onset are joined, and HED refuses what is
said twice.
"""

COLUMNS = ("trial", "attempt", "block", "outcome", "pair", "direction")
"""What of an event's data becomes a column of its own."""


def event_table(session: SessionRecord) -> "pd.DataFrame":
    """Return the events: onset, duration, trial_type, response_time, and what trial they are of.

    A trial's start lasts until its end; everything else is a moment. ``response_time`` is the time
    from the trial's start to the movement's onset.
    """
    import pandas as pd

    zero = session.streams["state"].time[0]
    events = session.events.sort_values("time", kind="stable")
    trials = session.trials
    ended = {(row["trial"], row["attempt"]): row for _, row in trials.iterrows()}
    rows = []
    tagged: set[tuple[float, str]] = set()
    for time, name, data in zip(events["time"], events["name"], events["data"], strict=True):
        moment = (float(time), str(name))
        key = (data.get("trial"), data.get("attempt"))
        row = ended.get(key) if name == "trial.start" else None
        rows.append(
            {
                "onset": time - zero,
                "duration": 0.0 if row is None else row["ended"] - time,
                "trial_type": name,
                "response_time": None if row is None else row.get("reaction_time"),
                "HED": None if moment in tagged else TAGS.get(name),
            }
            | {column: data.get(column) for column in COLUMNS}
        )
        tagged.add(moment)
    table = pd.DataFrame(rows)
    for name in ("trial", "attempt", "block"):
        table[name] = table[name].astype("Int64")
    return table


def event_description(table: "pd.DataFrame", context: dict[str, Any]) -> dict[str, Any]:
    """Return the sidecar: every column, and the levels of trial_type."""
    types = sorted(set(table["trial_type"]))
    return {
        "onset": {"Description": "from the first sample of motion", "Units": "s"},
        "duration": {"Description": "of a trial; 0 for a moment", "Units": "s"},
        "trial_type": {
            "LongName": "Event",
            "Description": "name of the event",
            "Levels": {name: name.replace(".", " ") for name in types},
        },
        "response_time": {
            "Description": "from the trial's start to the movement's onset",
            "Units": "s",
        },
        "trial": {"Description": "number of the trial in the session"},
        "attempt": {"Description": "counts from 1; more when the trial was repeated"},
        "block": {"Description": "number of the block in the session"},
        "outcome": {"Description": "how the trial ended"},
        "pair": {"Description": "pair of targets"},
        "direction": {"Description": "away from the machine's base, or towards it"},
        "StimulusPresentation": {
            "OperatingSystem": str(context.get("versions", {}).get("system", "n/a")),
            "SoftwareName": "labcrane",
            "SoftwareVersion": str(context.get("versions", {}).get("labcrane", "n/a")),
            "Code": "n/a",
        },
    }
