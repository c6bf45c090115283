"""A study whose plugin fails as it is ordered to."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from rehearsal import ScriptedConsole

from labcrane import open_recording
from labcrane.recording import SessionRecord
from labcrane.recording.frame_log import FrameLog
from labcrane.session import session as session_module
from labcrane.testing import Command, Order, Visit, discover, load, run

STUDY = """\
labcrane: 1
study: {study}
title: A study with a faulty plugin
rate_hz: 240
machine: ch8
input: {{use: dual_joystick}}
operator: {{use: faulty_input}}
scheme:
  use: faulty_scheme
  map: {{slew: -left.x, elbow: left.y, wrist: -right.x, shoulder: -right.y}}
dynamics: {{use: faulty_dynamics}}
tasks:
  aiming: {{use: faulty_task, distances: [2], movements: 1, limit_s: 0.5}}
sessions:
  - name: only
    steps:
      - block: {{task: aiming, pairs: 1}}
      - questionnaire: faulty_questionnaire
      - block: {{task: aiming, pairs: 1}}
"""


Spoil = Callable[[str], Path]


def run_fast(protocol: Path) -> None:
    study = load(protocol, discover(study=protocol))
    visit = Visit(study, "P001", 1, protocol.parent / "data", simulated=True, fast=True)
    wanted = (protocol.parent / "plugins" / "order.txt").read_text().split()[1]
    override = {20: [Command(Order.OVERRIDE)]} if wanted == "lift_limits" else {}
    run(visit, ScriptedConsole(override))


def run_through(protocol: Path) -> None:
    """Run fast, but write frames through and say where it is, as a session with people does."""
    session_module.BatchLog = FrameLog
    session_module._watching = lambda visit, rig: visit.study.call_monitor.published(
        visit.crash_marker
    )
    run_fast(protocol)


def recorded(protocol: Path) -> SessionRecord | None:
    """Return the session, if there is one, and see that no tick is missing."""
    files = list(protocol.parent.glob("data/*/*.h5"))
    if not files:
        return None
    session = open_recording(files[0]).session(1)
    ticks = session.streams["loop"].data["tick"].to_numpy()
    np.testing.assert_array_equal(ticks, np.arange(len(ticks)))
    return session


METHODS = {
    "input": {"open": 1, "begin_trial": 2, "read": 50, "close": 1, "metadata": 1},
    "scheme": {"open": 1, "begin_trial": 2, "command": 50, "idle": 1, "close": 1, "metadata": 1}
    | {"inverse": 20},
    "dynamics": {"open": 1, "begin_trial": 2, "state": 50, "step": 50, "bodies": 1, "close": 1}
    | {"metadata": 1},
    "task": {"factors": 1, "plan": 1, "open": 1, "begin_trial": 2, "evaluate": 50, "close": 1}
    | {"lift_limits": 1},
    "questionnaire": {"items": 2, "score": 1},  # the first says what will be asked
}
"""Every method that a simulated session calls, and at which call it fails."""


CASES = [(role, method, at) for role, calls in METHODS.items() for method, at in calls.items()]


RUNNING = {
    "begin_trial",
    "read",
    "command",
    "inverse",
    "state",
    "step",
    "evaluate",
    "lift_limits",
    "items",
    "score",
}


def line_of(text: str) -> int:
    lines = Path(__file__).with_name("faulty.py").read_text().splitlines()
    return 1 + next(at for at, line in enumerate(lines) if text in line)


def run_again(protocol: Path) -> None:
    """Mend the plugin and go on, as the protocol's policy says: the trial is done again."""
    (protocol.parent / "plugins" / "order.txt").write_text("nobody nothing 1 raising")
    study = load(protocol, discover(study=protocol))
    visit = Visit(
        study, "P001", 1, protocol.parent / "data", simulated=True, fast=True, resumed=True
    )
    run(visit, ScriptedConsole())
    session = open_recording(visit.folder.participant_file).session(1)
    last = session.trials.groupby("trial").tail(1)
    assert last["outcome"].isin(["success", "timeout"]).all()
    assert len(last) == 2
