"""Session windows: when a participant may be run, and their entries in the register."""

from datetime import date, timedelta

from labcrane.design.slots import group_of
from labcrane.errors import ProtocolError
from labcrane.participants.folders import Places
from labcrane.participants.register import Entry, Register, Sitting, changed
from labcrane.protocol.study import Study
from labcrane.recording.data_folder import DataFolder


def check_visit(
    register: Register, study: Study, participant: str, session: int, today: date
) -> None:
    """Raise :class:`ProtocolError` unless ``participant`` may be run today."""
    entry = register.entry(participant)
    register.check_study(study.protocol.study)
    if entry.exclusion:
        raise ProtocolError(
            f"participant {participant} was excluded on {entry.exclusion.date}: "
            f"{entry.exclusion.reason}"
        )
    check_group(study, participant, entry)
    _check_window(study, participant, entry, session, today)


def check_group(study: Study, participant: str, entry: Entry) -> None:
    """Refuse a participant whom the register and the protocol put into different groups."""
    groups = tuple(study.protocol.design.groups)
    planned = group_of(study.protocol.study, groups, entry.slot)
    if entry.group != planned:
        raise ProtocolError(
            f"participant {participant} would be in two groups: enrolled in {entry.group!r}, but "
            f"slot {entry.slot} of the protocol is in {planned!r}; restore the groups of the "
            "protocol, or enrol the participant again"
        )


def _check_window(study: Study, participant: str, entry: Entry, session: int, today: date) -> None:
    if session == 1:
        return
    begun = {sitting.session: date.fromisoformat(sitting.date) for sitting in entry.sessions}
    if session - 1 not in begun:
        raise ProtocolError(
            f"participant {participant} has not run session {session - 1}; session {session} "
            "comes after it"
        )
    window = study.protocol.sessions[session - 1].after_days
    days = days_of(session, window, begun[session - 1], entry)
    if session in begun or days is None or window is None:
        return
    first, last = days
    if not first <= today <= last:
        raise ProtocolError(
            f"session {session} of participant {participant} is due {first} to {last}, "
            f"{window[0]} to {window[1]} days after session {session - 1}; today is {today}; "
            "labcrane waive lets it be run, as a deviation"
        )


def days_of(
    session: int, after_days: tuple[int, int] | None, before: date, entry: Entry | None
) -> tuple[date, date] | None:
    """Return the first and last day on which a session may be run; None if every day is allowed.

    Parameters
    ----------
    after_days
        Of the protocol.
    before
        When the session before it was.
    entry
        The participant's, with the sessions whose window was waived.
    """
    if after_days is None or (entry is not None and str(session) in entry.waivers):
        return None
    first, last = (before + timedelta(days) for days in after_days)
    return first, last


def enter_sitting(places: Places, participant: str, sitting: Sitting) -> None:
    """Write into the register that a session begins; one that is recorded already stays."""
    recorded = recorded_sessions(places, participant)
    with changed(places) as register:
        entry = register.entry(participant)
        kept = [known for known in entry.sessions if known.session in recorded]
        if all(known.session != sitting.session for known in kept):
            kept.append(sitting)
        entry.sessions = sorted(kept, key=lambda known: known.session)


def recorded_sessions(places: Places, participant: str) -> list[int]:
    """Return the sessions of which there is a journal."""
    return DataFolder(places.root, participant, pilot=False, simulated=False).sessions()
