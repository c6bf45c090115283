"""Wake lock: keeps the screen awake, since joysticks do not reset a desktop's idle timer.

Linux is asked by the programs that desktops bring for it, macOS by ``caffeinate``; each holds the
lock for as long as its child runs, which ends with us, however we end. Windows is asked by
``SetThreadExecutionState``. Written after their documentation, and not tried on a desktop, a Mac or
Windows: of the programs only ``systemd-inhibit`` was run, and it found no logind.
"""

import ctypes
import select
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass

WHY = "a recorded session"
PATIENCE_S = 5.0
"""How long a program may take to get the lock: it asks another one over D-Bus."""

HELD = "held"
CHILD = ("/bin/sh", "-c", f"echo {HELD}; exec cat")
"""Says that the lock is held, for it is started then, and ends when its input does."""

PROGRAMS: Sequence[tuple[str, ...]] = (
    ("gnome-session-inhibit", "--inhibit", "idle:suspend", "--app-id", "labcrane", "--reason", WHY),
    ("kde-inhibit", "--power", "--screenSaver"),
    ("systemd-inhibit", "--what=idle:sleep", "--mode=block", "--who=labcrane", f"--why={WHY}"),
    ("caffeinate", "-d", "-i", "-s"),
)
"""What can be asked where it is installed: GNOME, KDE, any desktop that heeds logind, macOS."""

WINDOWS = "SetThreadExecutionState"
ES_CONTINUOUS, ES_SYSTEM_REQUIRED, ES_DISPLAY_REQUIRED = 0x80000000, 0x1, 0x2


@dataclass(frozen=True, slots=True)
class WakeLock:
    """Services that keep the screen awake, in words for the record.

    Attributes
    ----------
    held_by
        Programs, or the call, that hold it; none where the screen may blank or lock.
    failed
        What was asked and did not, each with why.
    """

    held_by: tuple[str, ...] = ()
    failed: tuple[str, ...] = ()


@contextmanager
def wake_lock() -> Iterator[WakeLock]:
    """Keep the screen awake while the block lasts, as far as the system lets us."""
    with _windows() if sys.platform == "win32" else _desktop() as lock:
        yield lock


@contextmanager
def _desktop() -> Iterator[WakeLock]:
    """Ask every program that is installed."""
    held, failed = [], []
    with ExitStack() as kept:
        for program, *arguments in PROGRAMS:
            if (path := shutil.which(program)) is None:
                continue
            why = kept.enter_context(_asked((path, *arguments)))
            if why:
                failed.append(f"{program}: {why}")
            else:
                held.append(program)
        yield WakeLock(tuple(held), tuple(failed))


@contextmanager
def _asked(command: tuple[str, ...]) -> Iterator[str]:
    """Give why a program does not hold the lock; nothing when it does."""
    process = subprocess.Popen(  # noqa: S603 - a program of the desktop's, by its name
        [*command, *CHILD],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        start_new_session=True,  # an interrupt at the terminal is ours
    )
    if process.stdin is None or process.stdout is None:
        raise AssertionError("it is started with pipes")
    with process:
        answered: Sequence[object] = ()
        try:
            answered, _, _ = select.select([process.stdout], [], [], PATIENCE_S)
            # A program that complains may run its child all the same, without a lock.
            said = process.stdout.readline().decode(errors="replace").strip() if answered else ""
            lost = said or f"no answer within {PATIENCE_S:g} s"
            yield "" if said == HELD else lost
        finally:
            process.stdin.close()
            if not answered:
                process.kill()


@contextmanager
def _windows() -> Iterator[WakeLock]:
    """Ask Windows, for the calling thread; it forgets when the thread ends."""
    ask = ctypes.WinDLL("kernel32").SetThreadExecutionState  # type: ignore[attr-defined, unused-ignore]
    if not ask(ES_CONTINUOUS | ES_SYSTEM_REQUIRED | ES_DISPLAY_REQUIRED):
        yield WakeLock(failed=(f"{WINDOWS}: Windows refused",))
        return
    try:
        yield WakeLock((WINDOWS,))
    finally:
        ask(ES_CONTINUOUS)
