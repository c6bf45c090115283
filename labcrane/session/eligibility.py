"""Eligibility of a session, and what the register keeps of it.

Two calls where a session is run: :func:`check_eligibility` before anything opens, which may be
repeated, and :func:`close_visit` when its participant file is written.
"""

from dataclasses import dataclass
from datetime import date, datetime
from typing import Any

from labcrane.approval.decision import otherwise_installed, verify
from labcrane.approval.lock import Lock
from labcrane.errors import ProtocolError
from labcrane.files.atomic import make_folder
from labcrane.participants.deviations import settle
from labcrane.participants.folders import Places, keep_private
from labcrane.participants.register import Sitting, read
from labcrane.participants.session_windows import check_visit, enter_sitting
from labcrane.registry.registry import discover
from labcrane.session.visit import Visit


@dataclass(frozen=True, slots=True)
class Admission:
    """On what grounds a session is run.

    Attributes
    ----------
    slot
        The participant's in the register; None for pilots and simulations.
    context
        For the record, ready for JSON.
    otherwise_installed
        What is installed in another way than when the study was approved, in words.
    """

    slot: int | None
    context: dict[str, Any]
    otherwise_installed: tuple[str, ...] = ()


EXEMPT = Admission(None, {"approval": "none"})
"""Pilots and simulations need no approval: what they leave is stamped PILOT or SIMULATED."""


def check_eligibility(visit: Visit, today: date | None = None) -> Admission:
    """Let a visit pass, or say why not; enter it in the register.

    Raises
    ------
    ProtocolError
        The study is not what was approved, or the packages are not and the protocol refuses that,
        the lock was rewritten by hand, the approval has expired, the participant is not in the
        register, has not consented to the approved text, was excluded, or comes too early or late.
    """
    if visit.simulated or visit.pilot:
        return EXEMPT
    today = today or datetime.now().astimezone().date()
    places = Places(visit.data)
    visit.study.check_participant(visit.participant)
    visit.study.check_session(visit.session)
    lock = verify(visit.study, discover(study=visit.study.path), today)
    register = read(places)
    register.check_finished()
    lock.check_before(register.locks)
    entry = register.participants.get(visit.participant)
    consents = entry.consent if entry else []
    given = [consent for consent in consents if consent.version == lock.consent_version]
    if entry is None or not given:
        raise ProtocolError(_no_consent(visit.participant, lock, [c.version for c in consents]))
    check_visit(register, visit.study, visit.participant, visit.session, today)
    sitting = Sitting(
        session=visit.session,
        date=today.isoformat(),
        lock=lock.seal,
        amendment=len(lock.amendments),
        consent=lock.consent_version,
    )
    make_folder(visit.folder.path)
    enter_sitting(places, visit.participant, sitting)
    others = tuple(otherwise_installed(lock))
    return Admission(
        entry.slot,
        {
            "approval": lock.approval["reference"],
            "approval_board": lock.approval["board"],
            "approval_valid_until": lock.approval["valid_until"],
            "amendments": len(lock.amendments),
            "lock": lock.seal,
            "consent_version": lock.consent_version,
            "consent_date": given[-1].date,
            "consent_by": given[-1].by,
            "otherwise_installed": list(others),
        },
        others,
    )


def close_visit(visit: Visit) -> None:
    """Write into the register how the session went, and keep its files to the user."""
    if visit.folder.path.is_dir():
        keep_private(visit.folder.path)
    if not (visit.simulated or visit.pilot):
        settle(Places(visit.data), visit.participant, visit.session)


def _no_consent(participant: str, lock: Lock, versions: list[str]) -> str:
    text = f"{lock.approval['consent']} (version {lock.consent_version})"
    other = f", only to version {', '.join(versions)}" if versions else ""
    return (
        f"participant {participant} has not consented to {text}{other}; once the participant has, "
        "confirm it with labcrane consent"
    )
