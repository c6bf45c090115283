"""Yoked control: the values of estimates that another participant's session used."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from labcrane.design.plan import plan_session
from labcrane.errors import ProtocolError
from labcrane.participants.folders import Places
from labcrane.participants.register import struck
from labcrane.protocol.estimated import OthersValues, estimate_signals
from labcrane.recording.data_folder import DataFolder, recorded
from labcrane.recording.participant_file.reader import Recording, SessionRecord
from labcrane.recording.paths import participant_path
from labcrane.session.resume import COMPLETE
from labcrane.session.visit import Visit


def yoked_to(visit: Visit, slot: int | None) -> dict[str, Any]:
    """Return which estimates of a new session are yoked, and to whom, for its context.

    Its values are those of the first participant who has completed the session in a group that is
    not yoked, and who was not taken in the participant's own group. Empty for own values.

    Raises
    ------
    ProtocolError
        There is no such participant yet. The message is the same for every group.
    """
    study = visit.study
    group = plan_session(study, visit.participant, visit.session, slot).group
    names = [name for name, each in study.estimates.items() if group in each.yoked]
    if visit.fast or not names:
        return {}
    yoked = {group for each in study.estimates.values() for group in each.yoked}
    excluded = struck(Places(visit.data))
    complete, taken = [], set()
    for folder in recorded(visit.data):
        other = replace(visit, participant=DataFolder.pseudonym(folder.name))
        path = participant_path(folder)
        if other.folder.path != folder or folder.name in excluded or not path.exists():
            continue  # of another kind, or without a file yet
        recording = Recording(path)
        if visit.session not in recording.sessions:
            continue
        session = recording.session(visit.session)
        context = session.context
        if context["group"] == group:
            taken.add(context.get("yoked_to"))
        elif context["group"] not in yoked and _is_complete(session):
            complete.append(folder.name)
    left = [name for name in complete if name not in taken]
    if not left:
        raise ProtocolError(
            f"session {visit.session} of {visit.folder.name} cannot be run yet: it needs one more "
            "complete session of another participant; run that of another participant first"
        )
    return {"yoked_to": left[0], "yoked": names}


def _is_complete(session: SessionRecord) -> bool:
    events = session.events
    ends = events.loc[events["name"] == "session.end", "data"].tolist()
    return bool(ends) and ends[-1]["reason"] == COMPLETE


def values_of(visit: Visit, yoked: Mapping[str, Any]) -> dict[str, OthersValues]:
    """Return what a session with this context gets instead of its own values, by estimate."""
    if not yoked:
        return {}
    path = participant_path(visit.data / str(yoked["yoked_to"]))
    streams = Recording(path).session(visit.session).streams
    loop = streams["loop"].columns(("due", "trial", "elapsed"))
    due, trial = loop["due"], loop["trial"]
    begun = (np.diff(trial, prepend=0.0) != 0.0) | (np.diff(loop["elapsed"], prepend=0.0) < 0.0)
    # The last attempt at a trial replaces those before it.
    starts = dict(zip(trial[begun].astype(int).tolist(), due[begun].tolist(), strict=True))
    found = {}
    for name in yoked["yoked"]:
        settings = visit.study.estimates[name]
        columns = [each.name for each in estimate_signals(name, settings)]
        rows = np.column_stack(list(streams["input"].columns(columns).values()))
        found[name] = OthersValues(due, starts, rows, settings.at_most_age_s)
    return found
