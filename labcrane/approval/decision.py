"""Approval and amendment of a study, and the check that it is unchanged."""

import os
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Any

from labcrane.approval import codebook
from labcrane.approval.difference import differences
from labcrane.approval.environment import changes, environment
from labcrane.approval.lock import FORMAT, VERSION, Lock, lock_path, read_lock
from labcrane.approval.materials import materials
from labcrane.approval.recordings import check_consent_names
from labcrane.errors import ProtocolError
from labcrane.files.atomic import SHARED_FILE, copy
from labcrane.files.units import unit_of
from labcrane.protocol.referenced_files import plain_settings
from labcrane.protocol.study import Study
from labcrane.registry.registry import Registry


@dataclass(frozen=True, slots=True)
class Grant:
    """A board's approval.

    Attributes
    ----------
    board, reference
        The board that approved the study, and its reference number.
    valid_until
        Last day on which a person may take part.
    consent
        The consent text, in the protocol's folder or below it.
    """

    board: str
    reference: str
    valid_until: date
    consent: Path


def approve(study: Study, registry: Registry, grant: Grant, today: date) -> Lock:
    """Write the lock of a study that has none.

    Raises
    ------
    ProtocolError
        The study has a lock, or the grant is not possible.
    """
    if lock_path(study.path).exists():
        raise ProtocolError(
            f"{study.path} has been approved already, under "
            f"{read_lock(study.path).approval['reference']!r}; record changes with labcrane amend"
        )
    lock = _lock(study, registry, grant, today, [])
    lock.write()
    return lock


def amend(study: Study, registry: Registry, grant: Grant, why: str, today: date) -> Lock:
    """Replace the lock by one of the study as it is now, and keep the history.

    The replaced lock stays in the same folder, as ``protocol.lock.1.json``.

    Raises
    ------
    ProtocolError
        Nothing has changed, or the grant is not possible.
    """
    old = read_lock(study.path)
    new = _lock(study, registry, grant, today, old.amendments)
    changed = differences(old.content["materials"], new.content["materials"])
    changed += [f"environment: {each}" for each in otherwise_installed(old)]
    changed += [
        f"approval: {name} was {old.approval[name]!r}, is {new.approval[name]!r}"
        for name in ("board", "valid_until", "consent")
        if old.approval[name] != new.approval[name]
    ]
    if not changed:
        raise ProtocolError(f"{study.path} is as it was approved; there is nothing to amend")
    if not why.strip():
        raise ProtocolError("an amendment needs a reason; give one with --why")
    entry = {
        "number": len(old.amendments) + 1,
        "date": today.isoformat(),
        "reference": grant.reference,
        "why": why,
        "changes": changed,
        "replaces": old.seal,
    }
    kept = old.path.with_name(old.path.name.replace(".json", f".{entry['number']}.json"))
    copy(old.path, kept, SHARED_FILE)
    amended = Lock(new.path, {**new.content, "history": [*old.amendments, entry]})
    amended.write()
    return amended


def drift(study: Study, registry: Registry, lock: Lock) -> list[str]:
    """Return the differences from the approved study, in words; none if unchanged."""
    now = materials(study, registry, lock.consent)
    return differences(lock.content["materials"], now)


def otherwise_installed(lock: Lock) -> list[str]:
    """Return what is installed differently than when the study was approved, in words.

    A lock without packages, as the first ones were, gives no difference.
    """
    before = lock.content.get("environment")
    return changes(before, environment()) if before else []


def verify(study: Study, registry: Registry, today: date) -> Lock:
    """Return the lock of a study that may be run with people today.

    Raises
    ------
    ProtocolError
        It was not approved, the approval has expired, the study is not the approved one, or the
        installed packages are not and the protocol refuses that; the message has every difference
        on a line of its own.
    """
    check_person(study)
    lock = read_lock(study.path)
    lock.check_date(today)
    if changes := drift(study, registry, lock):
        listed = "\n".join(f"  {change}" for change in changes)
        raise ProtocolError(
            f"{study.path} is not the study that was approved under "
            f"{lock.approval['reference']!r}:\n{listed}\n"
            "undo the changes, record the board's decision with labcrane amend, or use --pilot"
        )
    if study.protocol.environment == "refuse" and (others := otherwise_installed(lock)):
        listed = "\n".join(f"  {each}" for each in others)
        raise ProtocolError(
            f"{study.path} was approved under {lock.approval['reference']!r} with other packages, "
            f"and specifies environment: refuse:\n{listed}\n"
            "install the approved packages; record the change with labcrane amend; or use "
            "--pilot"
        )
    return lock


def check_person(study: Study) -> None:
    """Make sure that a person moves the controls of a study.

    Raises
    ------
    ProtocolError
        Its input needs nobody, so that a recording would pass for a person's.
    """
    if not study.input.settings.person:
        raise ProtocolError(
            f"{study.path}: input: {study.input.name} moves the controls without a person; name "
            "the controls of the participants (an input of labcrane plugins), and use --simulate "
            "or --pilot to try the study without one"
        )


def _lock(
    study: Study, registry: Registry, grant: Grant, today: date, history: list[dict[str, object]]
) -> Lock:
    check_person(study)
    if grant.valid_until < today:
        raise ProtocolError(
            f"the approval ended on {grant.valid_until}, today is {today}; give the day until "
            "which it is valid"
        )
    consent = _consent(study, grant.consent)
    check_consent_names(study, consent)
    return Lock(
        lock_path(study.path),
        {
            "format": FORMAT,
            "format_version": VERSION,
            "approval": {
                "board": grant.board,
                "reference": grant.reference,
                "approved": today.isoformat(),
                "valid_until": grant.valid_until.isoformat(),
                "consent": consent.relative_to(study.path.parent).as_posix(),
            },
            "environment": environment(),
            "history": history,
            **_about(study, registry, consent),
        },
    )


def planned(study: Study, registry: Registry) -> Lock:
    """Return the content of a lock of a study before its approval, for a preregistration."""
    return Lock(lock_path(study.path), {"history": [], **_about(study, registry)})


def _about(study: Study, registry: Registry, consent: Path | None = None) -> dict[str, Any]:
    return {
        "study": study.protocol.study,
        "title": study.protocol.title,
        "materials": materials(study, registry, consent),
        "machine_title": study.machine.title,
        "settings": {
            part: _settings(study, part)
            for part in study.choices
            if part.startswith(("tasks.", "estimates.", "feedback."))
        },
        "codebook": codebook.rows(codebook.codebook(study)),
    }


def _settings(study: Study, part: str) -> dict[str, dict[str, Any]]:
    """Return the settings of a part in effect, with units, and whether the protocol has them."""
    settings = study.choices[part].settings
    marks = {name: field.metadata for name, field in type(settings).model_fields.items()}
    return {
        name: {
            "value": value,
            "unit": unit_of(name, marks.get(name, [])) or "",
            "written": name in settings.model_fields_set,
        }
        for name, value in plain_settings(settings, study.path.parent).items()
    }


def _consent(study: Study, consent: Path) -> Path:
    """Return the consent text as a path through the protocol's folder, with which it moves."""
    if not consent.is_file():
        raise ProtocolError(f"there is no consent text {consent}; give its file with --consent")
    folder = Path(os.path.abspath(study.path.parent))  # noqa: PTH100 - links are left as they are
    absolute = Path(os.path.abspath(consent))  # noqa: PTH100
    if not absolute.is_relative_to(folder):
        raise ProtocolError(
            f"the consent text {consent} is not in the folder of the protocol, {folder}; put it "
            "there, so that it moves with the study"
        )
    return study.path.parent / absolute.relative_to(folder)
