"""The contract of exporters, and a recorded participant for it."""

from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from labcrane.analysis.cohort import Participant, Status
from labcrane.analysis.exporter import Exporter
from labcrane.core.records import Event
from labcrane.machines.kinematics import Arm
from labcrane.machines.library import load_machine
from labcrane.machines.machine import Machine
from labcrane.recording.journal import Column, SessionJournal
from labcrane.recording.participant_file.writer import consolidate

RATE_HZ = 100.0
MOVEMENT_S = 2.0
PARTICIPANT_TRIALS = 4
"""Trials of :func:`make_participant`."""

POINT = ("x", "y", "z")


def make_participant(folder: Path, name: str = "P001") -> Participant:
    """Return a made-up participant, whose slew goes to and fro four times, in a file in ``folder``.

    It goes as a minimum-jerk movement does; the sticks follow its speed.
    """
    path = folder / name / f"{name}.h5"
    path.parent.mkdir()
    journal = path.parent / "ses-01_run.xdf"
    _write(journal, name)
    consolidate(path, [journal])
    return Participant(name, path, Status.COMPLETE, "made up")


def _write(path: Path, name: str) -> None:
    machine = load_machine("ch8")
    with SessionJournal(path, _columns(machine), RATE_HZ) as journal:
        journal.write_event(Event("session.start", 0.0, _context(name)), 0)
        tick, dt = 0, 1.0 / RATE_HZ
        for trial in range(1, PARTICIPANT_TRIALS + 1):
            began = tick * dt
            journal.write_event(Event("trial.start", began, {"trial": trial, "attempt": 1}), tick)
            for number, row in enumerate(_movement(machine, outward=bool(trial % 2))):
                stamp = tick * dt
                head = (tick, stamp, stamp, 0.0, trial, number * dt, 1.0, 0.0)
                journal.write_frame(stamp, np.array([*head, *row], np.float64))
                tick += 1
            journal.write_event(Event("trial.end", (tick - 1) * dt, _row(trial, began)), tick - 1)
        journal.write_event(Event("session.end", tick * dt, {"reason": "complete"}), tick - 1)


def _columns(machine: Machine) -> tuple[Column, ...]:
    joints = machine.names
    return (
        *(Column("loop", label, "1") for label in ("tick", "due", "woke", "wrote")),
        *(Column("loop", label, "1") for label in ("trial", "elapsed", "phase", "paused")),
        *(Column("input", label, "1") for label in ("left.x", "left.y", "right.x", "right.y")),
        *(Column("command", f"command.{joint}", "rad/s") for joint in joints),
        *(Column("state", f"joint.angle.{joint}", "rad") for joint in joints),
        *(Column("state", f"tip.position.{axis}", "m") for axis in POINT),
        *(Column("state", f"tip.velocity.{axis}", "m/s") for axis in POINT),
        Column("task", "target.radius", "m"),
    )


def _context(name: str) -> dict[str, Any]:
    return {
        "study": "contract",
        "title": "A made-up study",
        "participant": name,
        "session": 1,
        "session_name": "only",
        "started": "2026-01-02T03:04:05.678+00:00",
        "simulated": False,
        "pilot": False,
        "rate_hz": RATE_HZ,
        "protocol": "sessions: [{name: only}]",
        "machine": (files("labcrane") / "machines" / "data" / "ch8.yaml").read_text(
            encoding="utf-8"
        ),
        "versions": {"labcrane": "0"},
        "trial_units": {"movement_time": "s", "distance": "m", "error": "m"},
    }


def _movement(machine: Machine, *, outward: bool) -> Iterator[list[float]]:
    """Yield input, command, state and task of every tick of a movement."""
    arm, ticks = Arm(machine), round(MOVEMENT_S * RATE_HZ)
    before: np.ndarray | None = None
    for tick in range(-1, ticks):
        s = (tick + 1) / ticks
        way = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
        angles = (0.5 * (way if outward else 1.0 - way), *machine.rest[1:])
        tip = np.array(arm.tip(angles))
        if before is not None:
            push = 30.0 * s**2 * (1.0 - s) ** 2 / 2.0
            command = (push * 0.1, *(0.0 for _ in angles[1:]))
            velocity = (tip - before) * RATE_HZ
            yield [push, 0.0, push / 2.0, 0.0, *command, *angles, *tip, *velocity, 0.25]
        before = tip


def _row(trial: int, began: float) -> dict[str, float | int | str | bool | None]:
    ends: dict[str, float] = {}
    for name, y in (("start", 0.0), ("target", 1.0)):
        ends |= {f"{name}_x": 5.0, f"{name}_y": y if trial % 2 else 1.0 - y, f"{name}_z": 1.0}
    return {
        "trial": trial,
        "attempt": 1,
        "block": 1,
        "practice": False,
        "counted": True,
        "pair": "near" if trial <= PARTICIPANT_TRIALS // 2 else "far",
        "distance": 1.0,
        "width": 0.5,
        "difficulty": float(np.log2(3.0)),
        "far_side": "left",
        "direction": "outward",
        **ends,
        "outcome": "success",
        "reaction_time": 0.1,
        "movement_onset": 0.1,
        "onset_speed": 0.02,
        "onset_hold": 0.1,
        "movement_time": MOVEMENT_S - 0.2,
        "error": 0.02,
        "error_along": 0.01,
        "started": began,
        "ended": began + MOVEMENT_S - 1.0 / RATE_HZ,
    }


class ExporterContract:
    """What every exporter must do. Provide the fixture ``exporter``."""

    def test_an_export_has_files_of_every_participant(
        self, exporter: Exporter, tmp_path: Path
    ) -> None:
        people = [make_participant(tmp_path, name) for name in ("P001", "P002")]
        out = tmp_path / "out"
        out.mkdir()
        exporter.export(people, out)
        names = " ".join(str(path.relative_to(out)) for path in out.rglob("*"))
        contents = b"".join(path.read_bytes() for path in out.rglob("*") if path.is_file())
        for person in people:
            assert person.name in names or person.name.encode() in contents, (
                f"export() of two participants left nothing of {person.name}, neither in a file's "
                f"name nor in its contents; there is: {names or 'no file'}; write every one that "
                "it is given into the folder it is given"
            )

    def test_participants_are_gone_through_once(self, exporter: Exporter, tmp_path: Path) -> None:
        person = make_participant(tmp_path)
        out = tmp_path / "out"
        out.mkdir()
        asked: list[str] = []

        def once() -> Iterator[Participant]:
            asked.append(person.name)
            yield person

        exporter.export(once(), out)
        assert asked, "export() did not go through its participants; go through them once"
        assert asked == [person.name], (
            f"export() began {len(asked)} times with its participants; go through them once, for "
            "each is opened on the way and there may be thousands"
        )

    def test_recordings_are_not_touched(self, exporter: Exporter, tmp_path: Path) -> None:
        person = make_participant(tmp_path)
        before = person.path.read_bytes()
        out = tmp_path / "out"
        out.mkdir()
        exporter.export([person], out)
        assert person.path.read_bytes() == before, (
            f"export() changed the recording {person.path.name}; open it for reading only, and "
            "write into the folder that export() is given"
        )
        assert any(out.iterdir()), (
            "export() wrote nothing into the folder that it is given; write its files there"
        )
