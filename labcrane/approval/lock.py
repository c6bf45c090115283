"""The lock: what was approved, beside the protocol, sealed against edits by hand."""

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
"""What an approval says, in words."""


@dataclass(frozen=True, slots=True)
class Lock:
    """An approval, and everything it was given for.

    Attributes
    ----------
    path
        Where it is.
    content
        As it stands in the file, without the seal: ``approval``, ``materials``, ``codebook``,
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
        """What was changed since the first approval, in order."""
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
        """What identifies the approved consent text."""
        text = self.content["materials"]["consent"]
        return hashlib.sha256(_canonical(text).encode()).hexdigest()[:12]

    @property
    def replaced(self) -> frozenset[str]:
        """Seals of the locks that this one has replaced, by amendments."""
        return frozenset(entry["replaces"] for entry in self.amendments)

    def check_before(self, seals: Mapping[str, str]) -> None:
        """Raise :class:`ProtocolError` unless this lock is, or has replaced, every one of before.

        Whoever writes a lock anew can seal it anew; the register knows under which ones people
        have taken part.

        Parameters
        ----------
        seals
            Under which locks the study was run, each with what was run under it, in words.
        """
        known = self.replaced | {self.seal}
        if others := {seal: what for seal, what in seals.items() if seal not in known}:
            listed = "\n".join(f"  {what}: {seal[:12]}" for seal, what in others.items())
            raise ProtocolError(
                f"{self.path} ({self.seal[:12]}) is not the lock under which people took part, and "
                f"no amendment in it has replaced that one, so that it was not written by labcrane "
                f"amend:\n{listed}\nrestore the lock from a copy, and record what has changed with "
                "labcrane amend; for an approval of its own give another --data folder"
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
    """Return where the lock of a protocol is: ``protocol.lock.json``."""
    return protocol.with_name(f"{protocol.stem}.lock.json")


def read_lock(protocol: Path) -> Lock:
    """Read the lock beside ``protocol``.

    Raises
    ------
    ProtocolError
        There is none, it is none, or it was edited by hand.
    """
    path = lock_path(protocol)
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise ProtocolError(
            f"{protocol} has not been approved: there is no {path.name} beside it; record the "
            "approval with labcrane approve, or try the study out with --pilot"
        ) from None
    except (OSError, ValueError) as error:
        raise ProtocolError(_edited(path, f"it cannot be read: {error}")) from error
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise ProtocolError(_edited(path, "it is no lock of labcrane"))
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
    """Return what no lock of labcrane says, however it is sealed; None where all is well."""
    approval, materials = content.get("approval"), content.get("materials")
    history = content.get("history")
    if not (isinstance(approval, dict) and isinstance(materials, dict) and _is_history(history)):
        return "it lacks the approval, the materials or the history"
    if any(not isinstance(approval.get(name), str) for name in APPROVAL):
        return f"its approval does not say {', '.join(APPROVAL)}"
    try:
        date.fromisoformat(approval["valid_until"])
    except ValueError:
        return f"its approval is valid until {approval['valid_until']!r}, which is no day"
    consent, text = approval["consent"], materials.get("consent")
    if not (isinstance(text, dict) and list(text) == [consent]):
        return f"its approval is of the consent text {consent!r}, and its materials hold another"
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
