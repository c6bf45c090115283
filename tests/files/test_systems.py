"""What Windows and macOS do their own way: shown here by taking away what they do not have."""

import errno
import importlib.util
import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest

from labcrane import RecordingError
from labcrane.cli.typed import chunks_by_thread
from labcrane.core import Verdict
from labcrane.errors import StorageError
from labcrane.files import atomic, lock, system
from labcrane.files.append import AppendFile


def test_a_file_grows_where_the_system_has_neither_statvfs_nor_fdatasync(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    disk = os.statvfs(tmp_path)
    monkeypatch.delattr(os, "statvfs")
    monkeypatch.delattr(os, "fdatasync")
    # What shutil asks instead of os.statvfs; Windows' own call is not here.
    free = disk.f_bavail * disk.f_frsize
    monkeypatch.setattr(system.shutil, "disk_usage", lambda _: SimpleNamespace(free=free))
    synced: list[int] = []
    monkeypatch.setattr(os, "fsync", lambda fd: synced.append(os.fstat(fd).st_size))
    file = AppendFile(tmp_path / "x")
    file.write(b"two\nlines\n")
    file.close()
    assert file.free == free
    assert synced[-1] == 10


def test_free_space_is_what_the_system_says_of_the_disk(tmp_path: Path) -> None:
    usage = os.statvfs(tmp_path)
    assert system.free_bytes(tmp_path) == pytest.approx(usage.f_bavail * usage.f_frsize, rel=0.01)


def test_a_recording_is_opened_in_binary_mode(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from labcrane.files import append

    flag, opened, really = 0x8000, [], os.open
    monkeypatch.setattr(append, "BINARY", flag)

    def watched(path: object, flags: int, mode: int = 0o777) -> int:
        opened.append((Path(str(path)).name, bool(flags & flag)))
        return really(str(path), flags & ~flag, mode)

    monkeypatch.setattr(os, "open", watched)
    AppendFile(tmp_path / "x").close()
    assert ("x", True) in opened


def test_files_are_synced_by_handles_that_may_write(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import fcntl

    really = os.fsync

    def as_on_windows(fd: int) -> None:
        folder = Path(f"/proc/self/fd/{fd}").is_dir()
        if not folder and fcntl.fcntl(fd, fcntl.F_GETFL) & os.O_ACCMODE == os.O_RDONLY:
            raise OSError(errno.EBADF, "Bad file descriptor")
        really(fd)

    monkeypatch.setattr(os, "fsync", as_on_windows)
    atomic.write_text(tmp_path / "x", "ä\n")
    assert (tmp_path / "x").read_bytes() == "ä\n".encode()


class Locks(ModuleType):
    """msvcrt's locks: of bytes, refused when another open file has them, in all of a process."""

    LK_LOCK, LK_NBLCK = 1, 2

    def __init__(self) -> None:
        super().__init__("msvcrt")
        self.holders: dict[tuple[int, int, int], int] = {}
        self.tried = threading.Semaphore(0)

    def locking(self, fd: int, how: int, count: int) -> None:
        assert (how, count) == (self.LK_NBLCK, 1)  # LK_LOCK gives up after ten seconds
        status = os.fstat(fd)
        place = (status.st_dev, status.st_ino, os.lseek(fd, 0, os.SEEK_CUR))
        self.tried.release()
        if self.holders.setdefault(place, fd) != fd:
            raise PermissionError(errno.EACCES, "Permission denied")

    def closed(self, fd: int) -> None:
        self.holders = {place: each for place, each in self.holders.items() if each != fd}


@pytest.fixture
def windows(monkeypatch: pytest.MonkeyPatch) -> Iterator[Locks]:
    locks, close = Locks(), os.close
    monkeypatch.setitem(sys.modules, "msvcrt", locks)
    monkeypatch.setattr(lock, "sys", SimpleNamespace(platform="win32"))

    def closing(fd: int) -> None:
        locks.closed(fd)
        close(fd)

    monkeypatch.setattr(lock.os, "close", closing)
    yield locks
    assert not locks.holders


def test_a_lock_on_windows_is_waited_for_as_long_as_it_takes(
    tmp_path: Path, windows: Locks, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(lock, "LOOK_S", 0.0)
    order: list[str] = []

    def second() -> None:
        with lock.exclusive(tmp_path / "a.lock"):
            order.append("second")

    with lock.exclusive(tmp_path / "a.lock"):
        waiting = threading.Thread(target=second)
        waiting.start()
        for _ in range(30):  # LK_LOCK would have given up after ten
            windows.tried.acquire()
        order.append("first")
    waiting.join()
    assert order == ["first", "second"]


def test_a_folder_on_windows_is_held_by_one_at_a_time(tmp_path: Path, windows: Locks) -> None:
    refused = (
        f"^another labcrane process is working in {tmp_path}; wait for it, or give another folder "
    )
    with lock.alone_in(tmp_path):
        assert [path.name for path in tmp_path.iterdir()] == [".labcrane-at-work"]
        with pytest.raises(RecordingError, match=refused), lock.alone_in(tmp_path, wait=False):
            pass
    assert list(tmp_path.iterdir()) == []
    with lock.alone_in(tmp_path, wait=False):
        pass


def test_a_pipe_is_read_by_a_thread_to_its_end() -> None:
    ours, theirs = os.pipe()
    found = chunks_by_thread(ours, threading.Event())
    os.write(theirs, b"note a\nno")
    assert next(found) == b"note a\nno"
    os.write(theirs, b"te b\n")
    os.close(theirs)
    assert list(found) == [b"te b\n"]
    os.close(ours)


def test_who_reads_a_pipe_by_a_thread_goes_when_it_is_over() -> None:
    ours, theirs = os.pipe()
    over = threading.Event()
    over.set()
    assert list(chunks_by_thread(ours, over)) == []
    os.close(theirs)


class WindowsConsole(ModuleType):
    """msvcrt's keys: what was typed, each half of a pair by itself."""

    def __init__(self, typed: str) -> None:
        super().__init__("msvcrt")
        self.typed = list(typed)

    def kbhit(self) -> bool:
        return bool(self.typed)

    def getwch(self) -> str:
        return self.typed.pop(0)


def test_keys_of_a_windows_console_are_letters_and_arrows_are_none(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from labcrane.cli import typed

    console = WindowsConsole("p\xe0Häé\0;\ud83d\ude00à")
    monkeypatch.setitem(sys.modules, "msvcrt", console)
    with monkeypatch.context() as patch:
        patch.setattr(sys, "platform", "win32")
        spec = importlib.util.spec_from_file_location("typed_on_windows", typed.__file__)
        there = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(there)
    over = threading.Event()
    with there.single_keys():
        assert [there.next_key(over) for _ in range(5)] == ["p", "ä", "é", "😀", "à"]
    over.set()
    assert there.next_key(over) == ""


def test_what_is_printed_into_a_pipe_is_utf8_whatever_the_country(tmp_path: Path) -> None:
    (tmp_path / "Prüfung→.yaml").write_text("labcrane: 1\n", encoding="utf-8")
    country = os.environ | {"PYTHONIOENCODING": "cp1252", "PYTHONUTF8": "0"}
    command = [sys.executable, "-m", "labcrane", "check", "Prüfung→.yaml"]
    done = subprocess.run(command, cwd=tmp_path, env=country, capture_output=True, check=False)
    assert "Prüfung→.yaml" in (done.stdout + done.stderr).decode("utf-8")


def test_who_may_read_is_said_where_permissions_do_not_tell(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from labcrane.doctor import disk

    def said(folder: Path) -> list[tuple[str, str]]:
        return [
            (each.verdict, each.advice)
            for each in disk.light(folder, 1.0)
            if "who may" in each.text
        ]

    assert said(tmp_path) == []
    monkeypatch.setattr(disk, "PRIVATE_MODES", False)
    monkeypatch.setattr(Path, "home", lambda: tmp_path / "user")
    (tmp_path / "user" / "study").mkdir(parents=True)
    assert said(tmp_path / "user" / "study") == [(Verdict.PASS, "")]
    fix = f'icacls "{tmp_path}" /inheritance:r /grant:r "%USERNAME%:(OI)(CI)F"'
    assert said(tmp_path) == [(Verdict.WARN, fix)]


class Scanner:
    """Holds a file for some time, as programs do on Windows; the clock goes on by the waits."""

    def __init__(self, code: int, for_s: float, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = 0.0
        for name in ("replace", "rename"):
            self._refuse(name, code, for_s, monkeypatch)
        monkeypatch.setattr(atomic.time, "monotonic", lambda: self.now)
        monkeypatch.setattr(atomic.time, "sleep", self._wait)

    def _wait(self, seconds: float) -> None:
        self.now += seconds

    def _refuse(self, name: str, code: int, for_s: float, monkeypatch: pytest.MonkeyPatch) -> None:
        own = getattr(Path, name)

        def give(path: Path, target: Path) -> Path:
            if self.now < for_s:
                error = PermissionError(13, "Access is denied")
                error.winerror = code  # type: ignore[attr-defined]
                raise error
            return own(path, target)

        monkeypatch.setattr(Path, name, give)


@pytest.mark.parametrize("code", [5, 32, 33])
def test_what_a_scanner_holds_for_a_moment_is_replaced(
    code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "register.json"
    path.write_text("old")
    folder = tmp_path / ".bundle"
    folder.mkdir()
    scanner = Scanner(code, 1.9, monkeypatch)
    atomic.write_text(path, "new")
    assert path.read_text() == "new"
    assert scanner.now == pytest.approx(1.9, abs=0.06)
    scanner.now = 0.0
    atomic.give_name(folder, tmp_path / "bundle")
    assert (tmp_path / "bundle").is_dir()


@pytest.mark.parametrize(("code", "tried_s"), [(5, 2.0), (32, 2.0), (17, 0.0), (183, 0.0)])
def test_what_stays_refused_is_an_error_and_unchanged(
    code: int, tried_s: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "register.json"
    path.write_text("old")
    scanner = Scanner(code, 60.0, monkeypatch)
    with pytest.raises(StorageError, match="it is unchanged"):
        atomic.write_text(path, "new")
    assert scanner.now == pytest.approx(tried_s, abs=0.06)
    assert [each.name for each in tmp_path.iterdir()] == ["register.json"]
    assert path.read_text() == "old"
