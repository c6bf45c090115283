"""A file that only grows, written through to the operating system."""

import contextlib
import errno
import os
import threading
from pathlib import Path

from labcrane.errors import StorageError
from labcrane.files.atomic import PRIVATE_FILE, sync_folder
from labcrane.files.system import BINARY, free_bytes, sync

SYNC_S = 1.0
"""Longest time, in seconds, that data wait for the disk: what a power cut can take."""

REMEDIES = {
    errno.ENOSPC: "free space on the disk, then continue",
    errno.EDQUOT: "the disk quota is used up: free space, then continue",
    errno.EFBIG: "the file has reached its size limit: continue in a new segment",
    errno.EROFS: "the disk is read-only: check it, or record into another folder",
    errno.ESTALE: "connect its disk again, or restore its folder: new data wait meanwhile",
    errno.EIO: "the disk is failing: stop the session and save its data",
}


class AppendFile:
    """A new file, opened for appending and for nothing else.

    A block is handed to the operating system in one call, so it survives a crash of this process.
    A thread brings it to the disk at least once in ``sync_s`` seconds. It is not thread-safe: its
    owner keeps the calls in order.

    Parameters
    ----------
    path
        Must not exist: a recording is never appended to by a second process, nor overwritten.
    sync_s
        Seconds between two syncs.

    Attributes
    ----------
    size
        Bytes written in whole blocks.
    synced
        Bytes of them that are known to be on the disk.
    free
        Bytes free on the disk at the last sync; the session compares it with what it still needs.
    """

    def __init__(self, path: Path, sync_s: float = SYNC_S) -> None:
        self.path = path
        self.size = 0
        self._sync_s = sync_s
        self._fd = _create(path)
        self._identity = _identity(os.fstat(self._fd))
        self.free = free_bytes(path)
        self._ragged = False
        self.synced = 0
        self._failure: OSError | None = None
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._keep_syncing, name=f"sync {path.name}")
        self._thread.daemon = True
        self._thread.start()

    @property
    def failure(self) -> OSError | None:
        """Why the last sync failed; None when it did not. The next write raises it."""
        return self._failure

    @property
    def closed(self) -> bool:
        """Whether nothing more can be written."""
        return self._fd < 0

    def write(self, block: bytes) -> None:
        """Append a block, whole or not at all.

        Raises
        ------
        StorageError
            The block is not in the file; all before it are. It may be written again once the cause
            is gone. Also raised, before anything is written, when an earlier sync failed.
        """
        if not self._is_there():
            # What is written to a file without a name is lost when it is closed.
            raise self._error("write", OSError(errno.ESTALE, "the file was removed"))
        if self._failure is not None:
            failure, self._failure = self._failure, None
            raise self._error("bring to disk", failure) from failure
        if self._ragged:
            self._take_back()
        written = 0
        try:
            written = os.write(self._fd, block)
            while written < len(block):  # a short write comes before the error that explains it
                written += os.write(self._fd, block[written:])
        except OSError as failure:
            self._ragged = written > 0
            if self._ragged:
                # Tried again before the next block, and the reader copes with a torn tail.
                with contextlib.suppress(StorageError):
                    self._take_back()
            raise self._error("write", failure) from failure
        self.size += written

    def sync(self) -> None:
        """Bring all that was written to the disk now."""
        size = self.size
        try:
            sync(self._fd)
        except OSError as failure:
            raise self._error("bring to disk", failure) from failure
        self.synced = size

    def close(self) -> None:
        """Bring the rest to the disk and let go of the file; a second call does nothing."""
        if self._fd < 0:
            return
        self._stop.set()
        self._thread.join()
        try:
            self.sync()
        finally:
            os.close(self._fd)
            self._fd = -1

    def _is_there(self) -> bool:
        """Whether the path still names this file: its disk is mounted, its folder not removed.

        Asked before each write, which takes 2 µs: the system takes blocks for a file that nobody
        will find again as well.
        """
        try:
            return _identity(os.stat(self.path)) == self._identity  # noqa: PTH116 - half the time
        except OSError:
            return False

    def _take_back(self) -> None:
        """Cut the part of a block that went in before the disk refused the rest."""
        try:
            os.ftruncate(self._fd, self.size)
        except OSError as failure:
            raise self._error("take back part of a chunk in", failure) from failure
        self._ragged = False

    def _keep_syncing(self) -> None:
        while not self._stop.wait(self._sync_s):
            try:
                self.free = free_bytes(self.path)
                if self.size > self.synced:
                    size = self.size
                    sync(self._fd)
                    self.synced = size
            except OSError as failure:
                self._failure = failure

    def _error(self, action: str, failure: OSError) -> StorageError:
        remedy = REMEDIES.get(failure.errno or 0, "check the disk and the folder")
        if self._fd < 0:
            remedy = "it is closed: continue in a new segment"
        return StorageError(
            f"cannot {action} {self.path}: {failure.strerror}; "
            f"the {self.size} bytes before it are in the file; {remedy}"
        )


def _create(path: Path) -> int:
    """Open a new file, and make its name as durable as its content."""
    flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_EXCL | BINARY
    try:
        fd = os.open(path, flags, PRIVATE_FILE)
    except FileExistsError as error:
        raise StorageError(
            f"{path} already exists and is not overwritten; continue in a new segment"
        ) from error
    except OSError as error:
        remedy = REMEDIES.get(error.errno or 0, "check that the folder exists and can be written")
        raise StorageError(f"cannot create {path}: {error.strerror}; {remedy}") from error
    sync_folder(path.parent)
    return fd


def _identity(status: os.stat_result) -> tuple[int, int]:
    """Return the identity of a file on this computer."""
    return status.st_dev, status.st_ino
