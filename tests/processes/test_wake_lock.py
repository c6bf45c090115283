"""The screen kept awake by programs that stand in for a desktop's, and refuse or hang."""

import os
from pathlib import Path

import psutil
import pytest
from needs import needs
from rehearsal import SHORT, ScriptedConsole, a_study

import labcrane
from labcrane.core import Verdict
from labcrane.doctor.screen import examine
from labcrane.processes import wake_lock as module
from labcrane.processes.wake_lock import PROGRAMS, WakeLock, wake_lock
from labcrane.testing import Command, Order, Visit, run

GRANTS = '#!/bin/sh\nwhile [ "${1#/}" = "$1" ]; do shift; done\n"$@"\n'
"""Runs the command behind its options, which begins with a slash, as these programs do."""

REFUSES = "#!/bin/sh\necho 'Failed to inhibit: Access denied' >&2\nexit 1\n"
HANGS = "#!/bin/sh\nexec sleep 600\n"

pytestmark = needs("fork")


@pytest.fixture
def desktop(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder that has all the programs that are found."""
    folder = tmp_path / "bin"
    folder.mkdir()
    monkeypatch.setattr(module.shutil, "which", lambda name: find(folder / name))
    return folder


def find(path: Path) -> str | None:
    return str(path) if path.exists() else None


def install(folder: Path, name: str, text: str) -> None:
    (folder / name).write_text(text)
    (folder / name).chmod(0o755)


def children() -> list[psutil.Process]:
    return [
        each for each in psutil.Process(os.getpid()).children(recursive=True) if each.is_running()
    ]


@pytest.mark.parametrize("name", [program for program, *_ in PROGRAMS])
def test_a_program_holds_the_lock_for_as_long_as_the_block_lasts(name: str, desktop: Path) -> None:
    install(desktop, name, GRANTS)
    before = {each.pid for each in children()}
    with wake_lock() as lock:
        assert lock == WakeLock((name,), ())
        holding = [each for each in children() if each.pid not in before]
        assert holding
    assert not any(each.is_running() for each in holding)


def test_who_refuses_or_hangs_is_named_and_the_others_are_asked(
    desktop: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    install(desktop, "gnome-session-inhibit", REFUSES)
    install(desktop, "kde-inhibit", HANGS)
    monkeypatch.setattr(module, "PATIENCE_S", 0.3)
    with wake_lock() as lock:
        assert lock == WakeLock((), (
            "gnome-session-inhibit: Failed to inhibit: Access denied",
            "kde-inhibit: no answer within 0.3 s",
        ))  # fmt: skip
    assert not [each for each in children() if "sleep" in each.cmdline()]


def test_doctor_says_who_keeps_the_screen_awake_or_what_to_do(desktop: Path) -> None:
    (none,) = examine()
    assert (none.verdict, none.text) == (
        Verdict.WARN,
        "the screen may go blank or lock during a session: nothing keeps it awake (no program "
        "that can do so is installed)",
    )
    assert "switch off blanking" in none.advice
    install(desktop, "systemd-inhibit", GRANTS)
    (held,) = examine()
    assert (held.verdict, held.text) == (
        Verdict.PASS, "a session keeps the screen awake by systemd-inhibit",
    )  # fmt: skip


def test_the_record_of_people_says_who_kept_the_screen_awake(tmp_path: Path, desktop: Path) -> None:
    install(desktop, "systemd-inhibit", GRANTS)
    install(desktop, "kde-inhibit", REFUSES)
    study = a_study(tmp_path, SHORT.replace("dual_joystick", "simulated_operator"))
    for name, simulated in (("P001", False), ("P002", True)):
        own = {"simulated": simulated, "pilot": not simulated, "fast": True}
        visit = Visit(study, name, 1, tmp_path / "data", **own)
        path = run(visit, ScriptedConsole({3: [Command(Order.END)]}))
        context = labcrane.open_recording(path).session(1).context
        assert context.get("wake_lock") == (
            None if simulated else {
                "held_by": ["systemd-inhibit"],
                "failed": ["kde-inhibit: Failed to inhibit: Access denied"],
            }
        )  # fmt: skip
