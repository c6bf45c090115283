"""A disk that takes no more, a disk that cannot sync: refused by the real kernel."""

import os
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
from needs import need

from labcrane import RecordingError
from labcrane.files.append import AppendFile


@contextmanager
def limited() -> Iterator[None]:
    """No file may grow beyond 1000 bytes: the kernel refuses, as on a full disk.

    Within a test's body only: pytest itself writes, perhaps to a longer file, right after it.
    """
    need("limits of files")
    import resource

    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)


def test_a_block_that_does_not_fit_is_taken_back_whole(tmp_path: Path) -> None:
    path = tmp_path / "x"
    with limited():
        file = AppendFile(path)
        for _ in range(9):
            file.write(b"a" * 101)
        with pytest.raises(RecordingError, match=r"write .*x: File too large; the 909 bytes"):
            file.write(b"b" * 101)
        assert path.read_bytes() == b"a" * 909
        file.write(b"c" * 91)  # the rest of the room
        with pytest.raises(RecordingError, match="in a new segment"):
            file.write(b"d")
        file.close()
    assert path.read_bytes() == b"a" * 909 + b"c" * 91


def test_a_missing_folder_is_named(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"nowhere.x: No such file.*check that the folder"):
        AppendFile(tmp_path / "nowhere" / "x")


def descriptor(path: Path) -> int:
    """Return the descriptor under which this process has ``path`` open."""
    for fd in range(3, 1024):
        with suppress(OSError):
            if os.path.samestat(os.fstat(fd), path.stat()):
                return fd
    raise AssertionError(f"{path} is not open")


def test_a_failed_sync_is_raised_by_the_next_write(tmp_path: Path) -> None:
    """A pipe in the place of the file: the kernel takes the bytes, and refuses to sync them."""
    path = tmp_path / "x"
    file = AppendFile(path, sync_s=0.01)
    receiving, sending = os.pipe()
    fd = descriptor(path)
    kept = os.dup(fd)
    os.dup2(sending, fd)
    file.write(b"a")
    deadline = time.monotonic() + 240.0
    while file.failure is None:
        assert time.monotonic() < deadline
    with pytest.raises(RecordingError, match="cannot bring to disk"):
        file.write(b"b")
    assert os.read(receiving, 10) == b"a"
    os.dup2(kept, fd)
    file.close()
    for each in (receiving, sending, kept):
        os.close(each)


def test_a_file_is_synced_in_the_background(tmp_path: Path) -> None:
    """What the kernel still has to write back is known per file."""
    file = AppendFile(tmp_path / "x", sync_s=0.01)
    file.write(bytes(100_000))
    deadline = time.monotonic() + 240.0
    while file.synced < file.size:
        assert time.monotonic() < deadline
    assert file.free > 0
    file.close()
