"""Files that are replaced whole: a kill leaves the old one or the new one, never a part."""

import hashlib
import os
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from labcrane.errors import StorageError

PRIVATE_FILE = 0o600
PRIVATE_FOLDER = 0o700
"""Permissions of what concerns people: for the user only."""

SHARED_FILE = 0o644
"""Permissions of what belongs to the study: colleagues read it."""

UNFINISHED = ".unfinished"
"""End of the name of a file that is being written next to the one it will replace."""


PATIENCE_S = 2.0
"""Windows refuses to rename what another program has open: a virus scanner, OneDrive, for a
moment. How long it is tried again, in seconds."""

LOOK_S = 0.05

IN_USE = (5, 32, 33)
"""How Windows refuses it: access denied, sharing violation, lock violation."""


def give_name(source: Path, target: Path) -> None:
    """Give a file or folder its name; a file with that name is replaced.

    Raises
    ------
    OSError
        The system refuses, on Windows for two seconds if the reason may pass.
    """
    give = source.rename if source.is_dir() else source.replace
    deadline = time.monotonic() + PATIENCE_S
    while True:
        try:
            give(target)
        except OSError as error:
            if getattr(error, "winerror", None) not in IN_USE or time.monotonic() >= deadline:
                raise
            time.sleep(LOOK_S)
        else:
            return


def write_text(path: Path, text: str, mode: int = PRIVATE_FILE) -> None:
    """Write ``path``, bring it to the disk, and give it its name at last."""
    with replacing(path, mode) as beside:
        beside.write_text(text, encoding="utf-8", newline="\n")


def copy(source: Path, path: Path, mode: int = PRIVATE_FILE) -> None:
    """Copy a file in the same way."""
    with replacing(path, mode) as beside:
        shutil.copyfile(source, beside)


@contextmanager
def replacing(path: Path, mode: int = PRIVATE_FILE) -> Iterator[Path]:
    """Give a new file to be written; it takes the name ``path`` once it is on the disk.

    Whatever keeps it from being written whole, nothing of it is left.

    Raises
    ------
    StorageError
        It cannot be written; ``path`` is as it was.
    """
    beside = path.with_name(f".{path.name}{UNFINISHED}")
    try:
        make_folder(path.parent)
        beside.unlink(missing_ok=True)  # left by a process that was killed
        os.close(os.open(beside, os.O_WRONLY | os.O_CREAT | os.O_EXCL, PRIVATE_FILE))
        yield beside
        with beside.open("r+b") as file:  # Windows syncs only what may be written
            os.fsync(file.fileno())
        beside.chmod(mode)
        give_name(beside, path)
    except OSError as error:
        raise StorageError(
            f"cannot write {path}: {error.strerror or error}; it is unchanged: remove the cause, "
            "then try again"
        ) from error
    finally:
        with suppress(OSError):  # there is no such folder, or the disk is gone
            beside.unlink(missing_ok=True)
    sync_folder(path.parent)


def make_folder(path: Path) -> None:
    """Make a folder and those above it, where they are missing, for the user only."""
    for folder in reversed([path, *path.parents]):
        if not folder.exists():
            folder.mkdir(mode=PRIVATE_FOLDER, exist_ok=True)


def sync_folder(path: Path) -> None:
    """Bring the names in a folder to the disk, where the system can."""
    try:
        fd = os.open(path, os.O_RDONLY)
    except PermissionError:  # Windows opens no folders, and needs no sync of them
        return
    try:
        os.fsync(fd)
    finally:
        os.close(fd)


def sha256(path: Path) -> str:
    """Return the SHA-256 of a file, hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
