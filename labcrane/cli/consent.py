"""Consent before a session: asked at the terminal, or on the pages."""

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import typer

from labcrane.cli.commands.approval import today
from labcrane.cli.typed import from_terminal
from labcrane.core.records import Event
from labcrane.session.commands import Command, ConsentGiven, Order, QueueConsole, read_request

if TYPE_CHECKING:
    from labcrane.approval.lock import Lock
    from labcrane.session.visit import Visit

LOOK_S = 0.05
NOBODY = "nobody"


@dataclass(frozen=True)
class Missing:
    """A consent to the approved text that is not on record."""

    visit: "Visit"
    lock: "Lock"

    @property
    def text(self) -> tuple[str, str]:
        """File and version of the approved text."""
        return self.lock.approval["consent"], self.lock.consent_version

    def confirm(self, by: str) -> None:
        """Put the consent into the register."""
        from labcrane.participants.enrolment import confirm_consent
        from labcrane.participants.folders import Places
        from labcrane.web.server.access import PARTICIPANT

        visit = self.visit
        who: Literal["participant", "examiner"] = "participant" if by == PARTICIPANT else "examiner"
        places = Places(visit.data)
        confirm_consent(places, visit.study, visit.participant, self.text, today(), who)


def missing_consent(visit: "Visit") -> Missing | None:
    """Return the consent that a person has yet to give before the visit.

    Raises
    ------
    ProtocolError
        The study may not be run with people at all, or not with more than are enrolled.
    """
    if visit.pilot or visit.simulated:
        return None
    from labcrane.approval.decision import verify
    from labcrane.participants.enrolment import check_planned
    from labcrane.participants.folders import Places
    from labcrane.participants.register import read
    from labcrane.registry.registry import discover

    visit.study.check_participant(visit.participant)
    lock = verify(visit.study, discover(study=visit.study.path), today())
    register = read(Places(visit.data))
    lock.check_before(register.locks)
    check_planned(register, visit.study, visit.participant)
    entry = register.participants.get(visit.participant)
    if entry and any(given.version == lock.consent_version for given in entry.consent):
        return None
    return Missing(visit, lock)


def ask_for_consent(visit: "Visit", *, page: bool) -> None:
    """Ask the experimenter at the terminal for a consent that is not on record yet.

    Whether the study may be run at all is checked here, before any page is served.
    """
    missing = missing_consent(visit)
    if missing is None or not from_terminal():
        return
    file, version = missing.text
    other = "; n asks on the participant's page" if page else ""
    if typer.confirm(f"Has {visit.participant} consented to {file} (version {version}){other}?"):
        missing.confirm("examiner")


def await_consent(visit: "Visit", console: QueueConsole, say: Callable[[str], None]) -> None:
    """Ask on the pages for a consent that is not on record, until it is given or the run ends."""
    if (missing := missing_consent(visit)) is None:
        return
    file, version = missing.text
    needed = {"file": file, "version": version, "text": _words(missing.lock)}
    kept: list[Command] = []  # what is not for us is for the session
    with suppress(KeyboardInterrupt):  # which ends the run, as it ends a session
        say(f"waiting for {visit.participant}'s consent to {file} (version {version}) on the page")
        console.report(Event("consent.needed", time.perf_counter(), needed))
        while (by := _given(console, version, kept)) is None:
            time.sleep(LOOK_S)
        if by is not NOBODY:
            missing.confirm(by)
            given = {"version": version, "by": by or "terminal"}
            console.report(Event("consent.given", time.perf_counter(), given))
            for command in kept:
                console.give(command)


def _given(console: QueueConsole, version: str, kept: list[Command]) -> str | None:
    """Return who gave the consent, NOBODY when the run is to end; None while it is open."""
    by = None
    for command in console.commands():
        if command.order is Order.END:
            return NOBODY
        if read_request(command) == ConsentGiven(version):
            by = command.by
        else:
            kept.append(command)
    return by


def _words(lock: "Lock") -> str:
    """Return the approved text, if it is one that can be shown as it is."""
    (content,) = lock.content["materials"]["consent"].values()
    return "\n".join(content.get("lines", ()))
