"""Into the register: slot, consent, exclusion, notes."""

import re
from datetime import date
from typing import Literal

from labcrane.design.seeds import derive
from labcrane.design.slots import group_of, next_slot
from labcrane.errors import ProtocolError
from labcrane.files.names import check_name, twin_key
from labcrane.participants.folders import Places
from labcrane.participants.mentions import Mentions
from labcrane.participants.personal_data import personal
from labcrane.participants.register import Consent, Deviation, Entry, Exclusion, Register, changed
from labcrane.protocol.study import Study


def check_planned(register: Register, study: Study, participant: str) -> None:
    """Refuse a new participant beyond the number that the protocol states, as was approved.

    Who was excluded and has left the slot to another one does not count.

    Raises
    ------
    ProtocolError
        That many are enrolled already.
    """
    if (beyond := _beyond_planned(register, study, participant)) is not None:
        raise ProtocolError(
            f"{participant} would be participant {beyond} that are planned; exclude those who "
            "dropped out, amend participants: planned, or enrol with labcrane consent "
            "--beyond-planned, which is a deviation"
        )


def _beyond_planned(register: Register, study: Study, participant: str) -> str | None:
    """Return the number of a new participant beyond the plan, as ``5 of 4``; None within it.

    A protocol that states no number plans none.
    """
    people = study.protocol.participants
    if participant in register.participants or "planned" not in people.model_fields_set:
        return None
    count = 1 + len(register.slots())
    return f"{count} of {people.planned}" if count > people.planned else None


def _entry(
    register: Register, study: Study, participant: str, today: date, *, beyond_planned: bool
) -> Entry:
    register.check_finished()
    name = study.protocol.study
    register.check_study(name)
    register.study, register.pattern = name, study.protocol.participants.pattern
    if participant in register.participants:
        return register.participants[participant]
    if any(stone.participant == participant for stone in register.tombstones):
        raise ProtocolError(f"{participant} was erased; give the next participant a new pseudonym")
    check_apart(register, participant)
    groups = tuple(study.protocol.design.groups)
    slot = next_slot(name, groups, register.slots())
    entry = Entry(
        slot=slot,
        group=group_of(name, groups, slot),
        seed=derive(name, participant),
        enrolled=today.isoformat(),
    )
    if (beyond := _beyond_planned(register, study, participant)) is not None:
        if not beyond_planned:
            check_planned(register, study, participant)
        entry.deviations.append(
            Deviation(what="enrolled beyond the plan", detail=beyond, date=today.isoformat())
        )
    register.participants[participant] = entry
    return entry


def check_apart(register: Register, participant: str, instead_of: str = "") -> None:
    """Refuse a new pseudonym that could be taken for another one, in a text or by a disk.

    Parameters
    ----------
    instead_of
        The pseudonym that it replaces.
    """
    check_name(participant, "participant")
    if not re.search("[A-Za-z]", participant):
        raise ProtocolError(
            f"participant {participant!r} cannot be distinguished from an ordinary number and so "
            f"could not be erased from texts; add a letter: P{participant}"
        )
    for known in register.names():
        if known == instead_of:
            continue
        same = twin_key(known) == twin_key(participant)
        if same or Mentions([known]).of(participant) or Mentions([participant]).of(known):
            raise ProtocolError(
                f"participant {participant} could be taken for {known}, who is in the register: "
                "they differ only in capitals or hyphens, or one contains the other; give another "
                "pseudonym"
            )


def confirm_consent(
    places: Places,
    study: Study,
    participant: str,
    text: tuple[str, str],
    today: date,
    by: Literal["examiner", "participant"] = "examiner",
    *,
    beyond_planned: bool = False,
) -> Entry:
    """Record that a participant has consented, and enrol the participant if need be.

    Parameters
    ----------
    text
        File and version of the consent text in the lock.
    beyond_planned
        Whether a participant beyond the number that is planned is enrolled, which is a deviation.

    Raises
    ------
    ProtocolError
        The participant cannot be enrolled.
    """
    study.check_participant(participant)
    file, version = text
    with changed(places) as register:
        entry = _entry(register, study, participant, today, beyond_planned=beyond_planned)
        if all(consent.version != version for consent in entry.consent):
            entry.consent.append(Consent(version=version, file=file, date=today.isoformat(), by=by))
    return entry


def exclude(
    places: Places, participant: str, reason: str, today: date, *, keep_slot: bool = False
) -> None:
    """Record that a participant's data are not used, or that the participant has dropped out.

    The slot is free for another one, unless it is to be kept.
    """
    check_words(reason, "reason")
    with changed(places) as register:
        entry = register.entry(participant)
        entry.exclusion = Exclusion(date=today.isoformat(), reason=reason)
        entry.holds_slot = keep_slot


def note(places: Places, participant: str, text: str) -> None:
    """Keep a note on a participant."""
    check_words(text, "note")
    with changed(places) as register:
        register.entry(participant).notes.append(text)


def waive(places: Places, participant: str, session: int, reason: str, today: date) -> None:
    """Allow a session outside its window, which is a deviation."""
    check_words(reason, "reason")
    with changed(places) as register:
        entry = register.entry(participant)
        entry.waivers[str(session)] = reason
        entry.deviations.append(
            Deviation(what="window waived", session=session, detail=reason, date=today.isoformat())
        )


def check_words(text: str, what: str) -> None:
    """Refuse an empty text, and one that could identify a person."""
    if not text.strip():
        raise ProtocolError(f"a {what} cannot be empty; write it without names")
    if found := personal(text):
        raise ProtocolError(
            f"the {what} contains {found}, which could identify a person; remove that"
        )
