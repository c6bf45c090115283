"""The screen kept awake by the services of a desktop, or by none."""

from pathlib import Path

import pytest
from rehearsal import SHORT, ScriptedConsole, a_study

import labcrane
from labcrane.core import Verdict
from labcrane.doctor.screen import examine
from labcrane.testing import Command, Order, Visit, run

STAND_IN = "WAKEPY_FAKE_SUCCESS"
"""The variable with which wakepy does as if it had the lock, by a service of this name."""

SERVICE = "WakepyFakeSuccess"


def test_doctor_says_who_keeps_the_screen_awake_or_what_to_do(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("DBUS_SESSION_BUS_ADDRESS", "unix:path=/nowhere")
    (none,) = examine()
    assert none.verdict == Verdict.WARN
    assert "nothing keeps it awake (asked: org.freedesktop.ScreenSaver" in none.text
    assert "switch off blanking" in none.advice
    monkeypatch.setenv(STAND_IN, "1")
    (held,) = examine()
    assert held.verdict == Verdict.PASS
    assert held.text == f"a session keeps the screen awake by {SERVICE}"


def test_the_record_of_people_says_who_kept_the_screen_awake(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(STAND_IN, "1")
    study = a_study(tmp_path, SHORT.replace("dual_joystick", "simulated_operator"))
    for name, simulated in (("P001", False), ("P002", True)):
        own = {"simulated": simulated, "pilot": not simulated, "fast": True}
        visit = Visit(study, name, 1, tmp_path / "data", **own)
        path = run(visit, ScriptedConsole({3: [Command(Order.END)]}))
        context = labcrane.open_recording(path).session(1).context
        held = {"held_by": [SERVICE], "failed": []}
        assert context.get("wake_lock") == (None if simulated else held)
