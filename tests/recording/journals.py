"""Small journals, and the same journals written by another process."""

import json
import sys
import time
from pathlib import Path

import numpy as np
import numpy.typing as npt

from labcrane.core import Event
from labcrane.recording.journal import Column, SessionJournal

COLUMNS = (
    Column("loop", "tick", "1"),
    Column("loop", "trial", "1"),
    Column("input", "left.x", "1"),
    Column("command", "slew", "rad/s"),
    Column("state", "joint.angle.slew", "rad"),
    Column("state", "joint.angle.shoulder", "rad"),
    Column("task", "target.x", "m"),
)
RATE_HZ = 240.0
START = 1000.0
CONTEXT = {
    "study": "aiming",
    "participant": "P001",
    "session": 1,
    "simulated": True,
    "pilot": False,
    "seed": 12345678901234567890,
    "rate_hz": RATE_HZ,
    "protocol": "study: aiming\n",
    "protocol_sha256": "ab" * 32,
    "components": {"scheme": {"use": "joint"}},
    "trial_units": {"movement_time": "s", "started": "s"},
}


def frame(number: int) -> npt.NDArray[np.float64]:
    """One row that says which frame it is in every column."""
    row = number + np.arange(len(COLUMNS)) / 16
    row[0], row[1] = number, number // 10
    return row


def frames(count: int, first: int = 0) -> npt.NDArray[np.float64]:
    return np.array([frame(number) for number in range(first, first + count)])


def stamp(number: int) -> float:
    return START + number / RATE_HZ


def write(path: Path, count: int, first: int = 0, context: object = CONTEXT) -> Path:
    """Write a journal of ``count`` frames with a trial every ten, and close it."""
    with SessionJournal(path, COLUMNS, RATE_HZ) as journal:
        journal.write_event(Event("session.start", stamp(first), context), first)
        for number in range(first, first + count):
            journal.write_frame(stamp(number), frame(number))
            if number % 10 == 9:
                journal.write_event(Event("trial.end", stamp(number), trial(number)), number)
    return path


def trial(number: int) -> dict:
    return {
        "trial": number // 10,
        "counted": number % 20 == 9,
        "width": 0.3,
        "side": "left",
        "hit": number % 40 == 9,
        "movement_time": float("nan") if number == 29 else number / 7,
        **({"note": "late, ąę"} if number == 49 else {}),
    }


def main() -> None:
    """Write frames for ever, and say which ones were written; the test kills this process."""
    path, pause = Path(sys.argv[1]), float(sys.argv[2])
    journal = SessionJournal(path, COLUMNS, RATE_HZ)
    journal.write_event(Event("session.start", START, CONTEXT), 0)
    number = 0
    while True:
        journal.write_frame(stamp(number), frame(number))
        if number % 10 == 9:
            journal.write_event(Event("trial.end", stamp(number), trial(number)), number)
        sys.stdout.write(json.dumps(number) + "\n")
        sys.stdout.flush()
        number += 1
        if pause:
            time.sleep(pause)


if __name__ == "__main__":
    main()
