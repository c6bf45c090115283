"""One process at a time; a killed one holds nothing."""

import math
import os
import stat
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from labcrane.errors import StorageError
from labcrane.files.atomic import PRIVATE_FILE, make_folder

LOOK_S = 0.05
"""Interval at which a lock that another process holds is tried again, in seconds."""

REMOVED_S = 2.0
"""Windows refuses a file that is just being removed; how long it is tried again, in seconds."""


@contextmanager
def exclusive(path: Path) -> Iterator[None]:
    """Hold the lock file ``path``; wait while another process holds it."""
    make_folder(path.parent)
    fd = _opened(path)
    try:
        _lock(fd, wait=True)
        yield
    finally:
        os.close(fd)


@contextmanager
def held(path: Path, refusal: str, patience_s: float = 0.0) -> Iterator[None]:
    """Hold the lock file ``path`` in an existing folder; the lock ends with the process.

    Parameters
    ----------
    refusal
        The message when another process holds it; the number of that process is added.
    patience_s
        How long to wait for that process, in seconds.

    Raises
    ------
    StorageError
        Another process still holds it.
    """
    deadline = time.monotonic() + patience_s
    while (fd := _locked(path)) is None:
        if time.monotonic() >= deadline:
            raise StorageError(f"{refusal} (process {_owner(path)} holds {path})")
        time.sleep(LOOK_S)
    try:
        os.truncate(fd, 0)
        os.write(fd, f" {os.getpid()}\n".encode())
        yield
    finally:
        if sys.platform != "win32":
            path.unlink(missing_ok=True)  # while held: the lock of another process stays
        os.close(fd)
        if sys.platform == "win32":
            with suppress(OSError):  # another process may hold it by now
                path.unlink()


def _opened(path: Path) -> int:
    """Return the lock file, open; what a link in its place leads to is left alone.

    Raises
    ------
    StorageError
        A link or a folder is in its place, or it cannot be made.
    """
    if path.is_symlink():
        raise StorageError(NO_LOCK.format(path, "it is a link"))
    deadline = time.monotonic() + (REMOVED_S if sys.platform == "win32" else 0.0)
    while True:
        try:
            fd = os.open(path, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), PRIVATE_FILE)
        except PermissionError:
            if time.monotonic() >= deadline:
                raise
            time.sleep(LOOK_S / 10.0)
        except OSError as error:
            raise StorageError(NO_LOCK.format(path, error.strerror)) from error
        else:
            if stat.S_ISREG(os.fstat(fd).st_mode):
                return fd
            os.close(fd)
            raise StorageError(NO_LOCK.format(path, "it is not a file"))


NO_LOCK = "{} cannot be used as a lock: {}; remove it, then try again"


def _locked(path: Path) -> int | None:
    """Return an open file with the lock on it; None when another process has it."""
    fd = _opened(path)
    if not _lock(fd, wait=False):
        os.close(fd)
        return None
    if not _is_at(path, fd):  # its former holder has removed it meanwhile
        os.close(fd)
        return _locked(path)
    return fd


def _lock(fd: int, *, wait: bool) -> bool:
    """Lock a file, on Windows its first byte; False when another open file has the lock."""
    if sys.platform == "win32":
        import msvcrt  # noqa: PLC0415 - Windows only

        os.lseek(fd, 0, os.SEEK_SET)
        while True:
            try:
                msvcrt.locking(fd, msvcrt.LK_NBLCK, 1)
            except PermissionError:
                if not wait:
                    return False
                time.sleep(LOOK_S)  # Windows' own waiting, LK_LOCK, gives up after ten seconds
            else:
                break
    else:
        import fcntl  # noqa: PLC0415 - Unix only

        try:
            fcntl.flock(fd, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        except BlockingIOError:
            return False
    return True


def _is_at(path: Path, fd: int) -> bool:
    try:
        return os.path.samestat(path.stat(), os.fstat(fd))
    except FileNotFoundError:
        return False


def _owner(path: Path) -> str:
    """Return the number of the process that holds a lock, as it wrote it."""
    try:
        with path.open("rb") as file:
            file.seek(1)  # Windows lets nobody read the byte that is locked
            return file.readline(20).decode("ascii", "replace").strip() or "unknown"
    except OSError:
        return "unknown"


ALONE = ".labcrane-at-work"
"""The lock file of a folder on Windows, where a folder itself cannot be held."""


@contextmanager
def alone_in(folder: Path, *, wait: bool = True) -> Iterator[None]:
    """Hold a folder, which is there: without a lock file, but on Windows.

    Raises
    ------
    StorageError
        Another process holds it, and it is not to be waited for.
    """
    if sys.platform == "win32":
        with held(folder / ALONE, BUSY.format(folder), math.inf if wait else 0.0):
            yield
    else:
        fd = os.open(folder, os.O_RDONLY)
        try:
            if not _lock(fd, wait=wait):
                raise StorageError(BUSY.format(folder))
            yield
        finally:
            os.close(fd)


BUSY = "another labcrane process is working in {}; wait for it, or give another folder"
