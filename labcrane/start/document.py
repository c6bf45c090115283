"""Document: a study's file while it is edited, with its draft on the disk and its undo.

What is typed is in a hidden draft next to the file within the same request: a computer that stops
loses nothing. The draft's name holds the hash of the file that it was begun from.
"""

import glob
import hashlib
import stat
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from labcrane.approval.lock import lock_path
from labcrane.errors import ProtocolError
from labcrane.files.atomic import SHARED_FILE, write_text
from labcrane.files.study_folder import OURS
from labcrane.files.yaml import parse_yaml, read_text
from labcrane.start.text import positions, ties

HASH = 16
"""Hexadecimal digits of a hash in a draft's name."""

DIGITS = "[0-9a-f]" * HASH
"""The hash, as a pattern."""

DEPTH = ("*", "*/*")
"""How deep files of a study are looked for in its folder."""

TEXTS = frozenset({".md", ".txt", ".yaml", ".yml"})
"""Files of a study that can be edited as text."""


class NewerFileError(ProtocolError):
    """Another program has changed the file since it was opened."""


class ApprovedError(ProtocolError):
    """The study is approved; saving it is a change that ``labcrane amend`` has to record."""


@dataclass
class Document:
    """A study's protocol, or another of its text files, as far as it was edited.

    Attributes
    ----------
    study
        The protocol of the study that the file belongs to.
    base
        Hash of the file from which the text comes.
    revision
        Grows with every change, so that two windows never overwrite each other.
    """

    path: Path
    study: Path
    base: str
    text: str
    revision: int = 0
    restored: bool = False
    _undo: list[str] = field(default_factory=list)
    _redo: list[str] = field(default_factory=list)
    _draft: Path | None = None

    @classmethod
    def open(cls, path: Path, study: Path | None = None) -> "Document":
        """Open a file, by default a protocol, with the draft of it that was not saved.

        Raises
        ------
        ProtocolError
            The file cannot be read as text, or has two kinds of line ends.
        """
        # Before the text: what another program writes in between is a newer file.
        raw = path.read_bytes() if path.is_file() else b""
        text = read_text(path)
        if 0 < raw.count(b"\r\n") < raw.count(b"\n"):
            raise ProtocolError(
                f"{path} has line ends of Windows and of other systems; save it with one kind"
            )
        opened = cls(path, study or path, _hash(raw), text)
        for draft in _drafts(path):
            unsaved = draft.read_text(encoding="utf-8")
            opened._undo.append(opened.text)
            opened.text, opened.base = unsaved, draft.name.split(".")[-2]
            opened.restored, opened._draft = True, draft
        return opened

    @property
    def draft(self) -> Path:
        """The file of the text as it is edited; it is checked there, next to what it refers to."""
        return self.path.with_name(f".{self.path.name}.{self.base}.unsaved")

    @property
    def unsaved(self) -> bool:
        """Whether the text differs from the file."""
        return self._draft is not None

    def change(self, revision: int, text: str) -> None:
        """Take a new text, and put the one before on the stack of undo.

        Raises
        ------
        ProtocolError
            ``revision`` is not the current one: another window has changed the text.
        """
        self.check_revision(revision)
        if text != self.text:
            self._undo.append(self.text)
            self._redo.clear()
            self._become(text)

    def undo(self, revision: int) -> None:
        """Take the last change back; nothing without one."""
        self.check_revision(revision)
        if self._undo:
            self._redo.append(self.text)
            self._become(self._undo.pop())

    def redo(self, revision: int) -> None:
        """Make the change again that was taken back last."""
        self.check_revision(revision)
        if self._redo:
            self._undo.append(self.text)
            self._become(self._redo.pop())

    def save(self, revision: int, *, over_newer: bool = False, over_approved: bool = False) -> None:
        """Write the file.

        Raises
        ------
        NewerFileError, ApprovedError
            The file has changed, or is approved, and this was not agreed to.
        """
        self.check_revision(revision)
        if self.changed_on_disk and not over_newer:
            raise NewerFileError(f"{self.path} was changed by another program since it was opened")
        if self.approved and not over_approved:
            raise ApprovedError(
                f"{self.path} belongs to an approved study; after a change, sessions run only once "
                "labcrane amend has recorded it"
            )
        ends = "\r\n" if b"\r\n" in self._raw() else "\n"
        written = self.text.replace("\n", ends)
        mode = stat.S_IMODE(self.path.stat().st_mode) if self.path.exists() else SHARED_FILE
        if not mode & stat.S_IWUSR:
            raise ProtocolError(f"{self.path} is read-only; make it writable, then save again")
        write_text(self.path, written, mode)
        self._drop()
        self.base, self.restored = _hash(written.encode()), False

    def reload(self, revision: int) -> None:
        """Take the file as another program left it; undo brings the text back."""
        self.check_revision(revision)
        base, before = _hash(self._raw()), self.text
        text = read_text(self.path)
        self._undo.append(before)
        self._drop()
        self.text, self.base, self.restored = text, base, False
        self.revision += 1

    @property
    def changed_on_disk(self) -> bool:
        """Whether another program has changed the file, or removed it."""
        return _hash(self._raw()) != self.base

    @property
    def approved(self) -> bool:
        """Whether the protocol has a lock; of another file, any protocol of the folder."""
        if self.path == self.study:
            return lock_path(self.study).exists()
        return any(self.study.parent.glob(lock_path(Path("*")).name))

    def shown(self) -> dict[str, Any]:
        """Return all that a page shows of it."""
        data, places, tied, why = None, [], [], ""
        try:
            if self.path == self.study:
                data = parse_yaml(self.text, self.path.name)
                places, tied = positions(self.text), ties(self.text)
        except (ProtocolError, ValueError, RecursionError) as error:
            why = str(error)
        folder = self.study.parent
        return {
            "path": str(self.path),
            "name": self.path.relative_to(folder).as_posix(),
            "study": self.study.name,
            "folder": str(folder),
            "revision": self.revision,
            "text": self.text,
            "data": data,
            "places": places,
            "tied": tied,
            "unreadable": why,
            "unsaved": self.unsaved,
            "restored": self.restored,
            "newer": self.changed_on_disk,
            "approved": self.approved,
            "undo": bool(self._undo),
            "redo": bool(self._redo),
            "protocols": [each.name for each in sorted(folder.glob("*.y*ml")) if is_protocol(each)],
            "files": sorted(
                each.relative_to(folder).as_posix()
                for pattern in DEPTH
                for each in folder.glob(pattern)
                if each.suffix in TEXTS and not each.name.startswith(".")
            ),
        }

    def check_revision(self, revision: int) -> None:
        """Raise :class:`ProtocolError` if another window has changed the study meanwhile."""
        if revision != self.revision:
            raise ProtocolError("another window has changed the study; reload this page")

    def _become(self, text: str) -> None:
        if _hash(self._raw()) == self.base and text == read_text(self.path):
            self._drop()
        else:
            write_text(self.draft, text, SHARED_FILE)
            self._draft = self.draft
        self.text = text
        self.revision += 1

    def _drop(self) -> None:
        for draft in _drafts(self.path):
            draft.unlink(missing_ok=True)
        self._draft = None

    def _raw(self) -> bytes:
        try:
            return self.path.read_bytes()
        except FileNotFoundError:
            return b""


def is_protocol(path: Path) -> bool:
    """Say whether a YAML file is a protocol, and not another file of a study."""
    try:
        return not path.name.startswith(".") and bool(OURS.search(path.read_bytes()))
    except OSError:
        return False  # gone, or not for this user


def drafted(folder: Path) -> set[Path]:
    """Return the files of a study's folder that have a draft."""
    found = (each for depth in DEPTH for each in folder.glob(f"{depth}.{DIGITS}.unsaved"))
    return {
        each.with_name(each.name[1:].rsplit(".", 2)[0]) for each in found if each.name[0] == "."
    }


def _drafts(path: Path) -> list[Path]:
    return sorted(path.parent.glob(f".{glob.escape(path.name)}.{DIGITS}.unsaved"))


def _hash(raw: bytes) -> str:
    return hashlib.sha256(raw).hexdigest()[:HASH]
