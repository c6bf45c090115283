"""Deviations from the protocol, from the events of a session."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from labcrane.errors import RecordingError
from labcrane.participants.folders import Places
from labcrane.participants.register import Deviation, Entry, changed, read, unregistered
from labcrane.recording.data_folder import DataFolder
from labcrane.recording.journal_reader import LoggedEvent, read_journal
from labcrane.recording.participant_file.reader import Recording
from labcrane.recording.paths import journal_path, participant_path, parts

ORDERS = {
    "order.skip": "skipped",
    "order.repeat": "trial repeated",
    "order.override": "automatic end overridden",
    "order.completion": "completion set by the experimenter",
}


def of_events(session: int, events: Iterable[LoggedEvent]) -> list[Deviation]:
    """Return the deviations among the events of one session, in order."""
    found: list[Deviation] = []
    trial, begun = 0, 0
    for event in events:
        if event.name == "trial.start":
            trial = int(event.data.get("trial", 0))
        if event.name == "session.start":
            begun += 1
            if begun > 1:
                found.append(Deviation(what="restarted", session=session, detail="after a stop"))
        elif (said := _said(event.name, event.data)) is not None:
            what, detail = said
            found.append(Deviation(what=what, session=session, trial=trial, detail=detail))
        if event.name == "trial.end":
            trial = 0
    return found


def _said(name: str, data: Mapping[str, Any]) -> tuple[str, str] | None:
    """Return the kind of deviation that an event is, and its details; None if it is none."""
    if name in ORDERS and not data.get("refused"):
        return ORDERS[name], str(data.get("text") or "")
    if name == "input.lost":
        return "input lost", str(data.get("why") or "")
    if name == "break.end" and float(data.get("left") or 0) > 0:
        return "break shortened", f"by {float(data['left']):.1f} s"
    if name == "practice.end" and not data.get("met"):
        return "practice criterion not met", f"{data.get('in_a_row')} of {data.get('wanted')}"
    if name == "session.end" and data.get("reason") != "complete":
        return "session ended early", str(data.get("reason") or "")
    return None


def of_journals(folder: Path, session: int) -> list[Deviation]:
    """Return the deviations of a recorded session; one that was cut off is a deviation itself."""
    found = parts(journal_path(folder, session, "run"))
    if not found:
        return []
    log, _ = read_journal(found)
    return _of_session(session, log.events)


def _of_session(session: int, events: Sequence[LoggedEvent]) -> list[Deviation]:
    deviations = of_events(session, events)
    if not any(event.name == "session.end" for event in events):
        deviations.append(
            Deviation(what="session cut off", session=session, detail="the program was stopped")
        )
    return deviations


def settle(places: Places, participant: str, session: int) -> None:
    """Write the deviations of a session that is over into the register.

    A session that never came to be recorded was none, and is taken out.
    """
    recorded = bool(parts(journal_path(places.raw(participant), session, "run")))
    found = of_journals(places.raw(participant), session)
    with changed(places) as register:
        entry = register.entry(participant)
        if not recorded:
            entry.sessions = [known for known in entry.sessions if known.session != session]
        for sitting in entry.sessions:
            if sitting.session == session:
                sitting.deviations = found


def all_deviations(places: Places) -> list[tuple[str, Deviation]]:
    """Return every participant's deviations.

    Those of killed sessions, and of participants and sessions that are not in the register, are
    read from the recordings. That they are not in the register is a deviation itself.
    """
    found = [
        (name, deviation)
        for name, entry in read(places).participants.items()
        for deviation in (*entry.deviations, *_of_sessions(places, name, entry))
    ]
    for name, why in unregistered(places).items():
        title, _, detail = why.partition(": ")
        found.append((name, Deviation(what=title, detail=detail)))
        found += [
            (name, deviation)
            for session in sessions_of(places, name)
            for deviation in _read(places.raw(name), session)
        ]
    return sorted(found, key=lambda each: each[0])


def _of_sessions(places: Places, name: str, entry: Entry) -> Iterable[Deviation]:
    sittings = {sitting.session: sitting.deviations for sitting in entry.sessions}
    for session in sorted({*sittings, *sessions_of(places, name)}):
        if session not in sittings:
            yield Deviation(what="session not in the register", session=session)
            yield from _read(places.raw(name), session)
        elif (settled := sittings[session]) is None:
            yield from of_journals(places.raw(name), session)
        else:
            yield from settled


def sessions_of(places: Places, name: str) -> list[int]:
    """Return the sessions of which there is a journal, or data in the participant file."""
    folder = DataFolder(places.root, name, pilot=False, simulated=False)
    path = folder.participant_file
    try:
        in_file = Recording(path).sessions if path.is_file() else ()
    except RecordingError:  # its journals may be readable
        in_file = ()
    return sorted({*folder.sessions(), *in_file})


def _read(folder: Path, session: int) -> list[Deviation]:
    """Return the deviations in a recording that was copied here; without journals, in its file."""
    try:
        if parts(journal_path(folder, session, "run")):
            return of_journals(folder, session)
        table = Recording(participant_path(folder)).session(session).events
    except RecordingError as error:
        return [Deviation(what="recording cannot be read", session=session, detail=str(error))]
    columns = table[["name", "time", "tick", "part", "data"]]
    return _of_session(session, [LoggedEvent(*row) for row in columns.itertuples(index=False)])
