"""The lock: the approved study, in the protocol's folder, sealed against manual edits."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import date
from pathlib import Path, PurePosixPath
from typing import Any

from labcrane.errors import ProtocolError
from labcrane.files.atomic import SHARED_FILE, write_text

FORMAT = "labcrane lock"
VERSION = 1
SEAL = "seal"
APPROVAL = ("board", "reference", "approved", "valid_until", "consent")
"""Texts of an approval."""


@dataclass(frozen=True, slots=True)
class Lock:
    """An approval, and everything that it covers.

    Attributes
    ----------
    path
        Its path.
    content
        The content of the file, without the seal: ``approval``, ``materials``, ``codebook``,
        ``history``.
    """

    path: Path
    content: dict[str, Any]

    @property
    def seal(self) -> str:
        """SHA-256 of the content in its canonical form."""
        return hashlib.sha256(_canonical(self.content).encode()).hexdigest()

    @property
    def approval(self) -> dict[str, Any]:
        """Board, reference, dates and consent text."""
        approval: dict[str, Any] = self.content["approval"]
        return approval

    @property
    def amendments(self) -> list[dict[str, Any]]:
        """Changes since the first approval, in order."""
        history: list[dict[str, Any]] = self.content["history"]
        return history

    @property
    def materials_sha256(self) -> str:
        """Hash of the study: equal wherever and however often the same study is approved."""
        return hashlib.sha256(_canonical(self.content["materials"]).encode()).hexdigest()

    @property
    def consent(self) -> Path:
        """The consent text."""
        return self.path.parent / str(self.approval["consent"])

    @property
    def consent_version(self) -> str:
        """Identifier of the approved consent text."""
        text = self.content["materials"]["consent"]
        return hashlib.sha256(_canonical(text).encode()).hexdigest()[:12]

    @property
    def replaced(self) -> frozenset[str]:
        """Seals of the locks that this one has replaced, by amendments."""
        return frozenset(entry["replaces"] for entry in self.amendments)

    def check_before(self, seals: Mapping[str, str]) -> None:
        """Raise :class:`ProtocolError` unless this lock is, or has replaced, every one of before.

        A rewritten lock can be sealed again; the register records under which ones people have
        taken part.

        Parameters
        ----------
        seals
            Seals of the locks under which the study was run, each with its sessions, in words.
        """
        known = self.replaced | {self.seal}
        if others := {seal: what for seal, what in seals.items() if seal not in known}:
            listed = "\n".join(f"  {what}: {seal[:12]}" for seal, what in others.items())
            raise ProtocolError(
                f"{self.path} ({self.seal[:12]}) is not the lock under which people took part, and "
                f"contains no amendment that replaces that lock, so labcrane amend did not write "
                f"it:\n{listed}\nrestore the lock from a copy, and record what has changed with "
                "labcrane amend; for a separate approval give another --data folder"
            )

    def check_date(self, today: date) -> None:
        """Raise :class:`ProtocolError` when the approval has expired."""
        last = date.fromisoformat(self.approval["valid_until"])
        if today > last:
            raise ProtocolError(
                f"the approval {self.approval['reference']!r} was valid until {last}, today is "
                f"{today}; record the board's extension with labcrane amend --valid-until"
            )

    def write(self) -> None:
        """Write the lock; a kill leaves the old one or the new one."""
        text = json.dumps({**self.content, SEAL: self.seal}, indent=1, ensure_ascii=False)
        write_text(self.path, text + "\n", SHARED_FILE)


def lock_path(protocol: Path) -> Path:
    """Return the path of a protocol's lock: ``protocol.lock.json``."""
    return protocol.with_name(f"{protocol.stem}.lock.json")


def read_lock(protocol: Path) -> Lock:
    """Read the lock in the folder of ``protocol``.

    Raises
    ------
    ProtocolError
        There is no lock, the file is not a lock, or it was edited by hand.
    """
    path = lock_path(protocol)
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise ProtocolError(
            f"{protocol} has not been approved: there is no {path.name} in its folder; record the "
            "approval with labcrane approve, or run a pilot session with --pilot"
        ) from None
    except (OSError, ValueError) as error:
        raise ProtocolError(_edited(path, f"it cannot be read: {error}")) from error
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise ProtocolError(_edited(path, "it is not a labcrane lock"))
    if content.get("format_version") != VERSION:
        raise ProtocolError(
            f"{path} has format version {content.get('format_version')!r}, this labcrane reads "
            f"{VERSION}; install the labcrane that the study was approved with"
        )
    seal = content.pop(SEAL, None)
    lock = Lock(path, content)
    if seal != lock.seal:
        raise ProtocolError(_edited(path, "its content does not match its seal"))
    if why := _misshapen(content):
        raise ProtocolError(_edited(path, why))
    return lock


def _misshapen(content: Mapping[str, Any]) -> str | None:
    """Return the part that cannot be from labcrane, whatever the seal; None if all is well."""
    approval, materials = content.get("approval"), content.get("materials")
    history = content.get("history")
    if not (isinstance(approval, dict) and isinstance(materials, dict) and _is_history(history)):
        return "it lacks the approval, the materials or the history"
    if any(not isinstance(approval.get(name), str) for name in APPROVAL):
        return f"its approval lacks {', '.join(APPROVAL)}"
    try:
        date.fromisoformat(approval["valid_until"])
    except ValueError:
        return f"its approval is valid until {approval['valid_until']!r}, which is not a date"
    consent, text = approval["consent"], materials.get("consent")
    if not (isinstance(text, dict) and list(text) == [consent]):
        return f"its approval is of the consent text {consent!r}, but its materials contain another"
    place = PurePosixPath(consent)
    if place.is_absolute() or ".." in place.parts:
        return f"its consent text {consent!r} is not in the folder of the protocol"
    return None


def _is_history(history: object) -> bool:
    return isinstance(history, list) and all(
        isinstance(entry, dict) and isinstance(entry.get("replaces"), str) for entry in history
    )


def _edited(path: Path, why: str) -> str:
    return (
        f"lock {path} was edited by hand or is damaged: {why}; restore it from a copy, and record "
        "changes with labcrane amend"
    )


def _canonical(content: object) -> str:
    return json.dumps(_plain(content), sort_keys=True, ensure_ascii=True, separators=(",", ":"))


def _plain(node: object) -> object:
    """Write 240.0 as 240: the same number, however it was written."""
    if isinstance(node, dict):
        return {key: _plain(value) for key, value in node.items()}
    if isinstance(node, list | tuple):
        return [_plain(value) for value in node]
    return int(node) if isinstance(node, float) and node.is_integer() else node
