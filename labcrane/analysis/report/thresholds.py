"""Thresholds from tracks: those of participants, and the error of such estimates."""

import json
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

from labcrane.analysis.cohort import Participant
from labcrane.analysis.report.html import Page
from labcrane.recording.participant_file.reader import SessionRecord

if TYPE_CHECKING:
    import pandas as pd

ENDED = "track.end"
LAW = "law"
"""Column of a track's description in the recording, as JSON; not shown."""

COLUMNS = (
    "participant", "session", "block", "track", "estimate", "sd", "responses", "ended", LAW,
)  # fmt: skip

Judge = Callable[[str, str], "pd.DataFrame"]
"""Returns how well a track finds thresholds, from its name and recorded description."""


def thresholds_of(participant: Participant) -> "pd.DataFrame":
    """Return a row for each block with a track: the track's state at its end.

    A block that was continued or repeated has the row of its last end.
    """
    import pandas as pd

    table = pd.DataFrame(participant.rows(_ends), columns=list(COLUMNS))
    return table.astype({"estimate": float, "sd": float})


def _ends(session: SessionRecord) -> Iterable[dict[str, Any]]:
    laws, events, rows = session.context.get("tracks", {}), session.events, {}
    for told in events.loc[events["name"] == ENDED, "data"]:
        name = str(told["track"])
        rows[told["block"]] = {
            "block": told["block_name"],
            "track": name,
            **{each: told.get(each) for each in ("estimate", "sd", "responses", "ended")},
            LAW: json.dumps(laws[name], sort_keys=True) if name in laws else "",
        }
    return rows.values()


def add_thresholds(page: Page, found: "pd.DataFrame", judge: Judge | None) -> None:
    """Add the thresholds and their accuracy; nothing without a track."""
    import pandas as pd

    if not len(found):
        return
    page.heading("Thresholds")
    page.say(
        "Results of tracks at the end of their blocks, in the unit of their levels: the threshold "
        "and its standard deviation by QUEST+, the mean of a staircase's levels at reversals and "
        "theirs. Empty where too little was known."
    )
    page.table("thresholds", found.drop(columns=LAW))
    laws = found.loc[found[LAW] != "", ["track", LAW]].drop_duplicates()
    if judge is None or not len(laws):
        return
    quality = pd.concat([judge(*law) for law in laws.itertuples(index=False)], ignore_index=True)
    page.say(
        "How far such estimates are off: bias and spread are mean and standard deviation of "
        "estimate minus truth, of simulated operators whose thresholds are known, spread evenly "
        "from the easiest to the hardest level; bias is also given for the tenth with the "
        "lowest thresholds and for that with the highest, which are estimated too far inward. "
        "Success falls with the level as QUEST+ assumes; for a staircase, which assumes nothing, "
        "as steeply as the row states."
    )
    page.table("track_quality", quality)
