"""What is left of people, and kills in the middle of keeping their data in order."""

import hashlib
import os
import shutil
import signal
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from governed import TODAY, Lab
from needs import need

from labcrane.participants import recovery as unfinished
from labcrane.participants.folders import Places
from labcrane.participants.register import read

REASON = "withdrew consent"


def copied(recorded: Lab, folder: Path) -> Lab:
    shutil.copytree(recorded.folder, folder / "lab")
    (folder / "store").mkdir()
    return lab_in(folder / "lab")


def lab_in(folder: Path) -> Lab:
    """Return the study that is in ``folder`` already."""
    lab = Lab.__new__(Lab)
    lab.folder, lab.protocol = folder, folder / "study.yaml"
    lab.places = Places(folder / "data")
    return lab


def store_of(lab: Lab) -> Path:
    return lab.folder.parent / "store"


def files(folder: Path) -> dict[str, str]:
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def others(folder: Path) -> dict[str, str]:
    return {name: sha for name, sha in files(folder).items() if "P001/" in name or "P002/" in name}


def check_erased(lab: Lab) -> None:
    """Search every byte that is left, here and in the store."""
    for root in (lab.places.root, store_of(lab)):
        for path in root.rglob("*"):
            assert "P007" not in path.name
            if path.is_file() and path != lab.places.register:
                assert b"P007" not in path.read_bytes(), path
    text = lab.places.register.read_text(encoding="utf-8")
    assert text.count("P007") == 1
    (stone,) = read(lab.places).tombstones
    assert (stone.participant, stone.reason) == ("P007", REASON)
    assert stone.date == TODAY.isoformat()


WRITES = frozenset({"os.remove", "os.rename", "os.rmdir", "os.mkdir", "os.truncate", "os.chmod"})


def killed_at(number: int, work: Callable[[], object]) -> bool:
    """Do ``work`` in a process that is killed before its ``number``-th write; whether it was."""
    need("fork")
    sys.stdout.flush()
    child = os.fork()
    if child == 0:
        seen = [0]

        def watch(event: str, details: tuple) -> None:
            writes = event in WRITES or (
                event == "open"
                and isinstance(details[2], int)
                and details[2] & (os.O_WRONLY | os.O_RDWR)
            )
            if writes:
                seen[0] += 1
                if seen[0] == number:
                    os.kill(os.getpid(), signal.SIGKILL)

        sys.addaudithook(watch)
        try:
            work()
        except BaseException:  # noqa: BLE001 - a child of pytest must never go on as pytest
            os._exit(1)
        os._exit(0)
    _, status = os.waitpid(child, 0)
    assert os.WIFSIGNALED(status) or os.WEXITSTATUS(status) == 0, "the work itself failed"
    return os.WIFSIGNALED(status)


# Everywhere on request; here and there, at all kinds of writes, with every change.
KILLS = [pytest.param(1, marks=pytest.mark.soak), pytest.param(7, marks=pytest.mark.long)]


def at_every_write(recorded: Lab, folder: Path, work, check, step: int) -> int:
    """Kill ``work`` before each ``step``-th of its writes, call it again, and check.

    Returns the number of writes, less those after the last kill.
    """
    number = 1
    while True:
        lab = copied(recorded, folder / str(number))
        unfinished.move(lab.places, store_of(lab))
        before = others(lab.folder)
        was_killed = killed_at(number, lambda lab=lab: work(lab))
        if was_killed:
            work(lab)
        check(lab)
        assert others(lab.folder) == before
        shutil.rmtree(folder / str(number))
        if not was_killed:
            return number - step
        number += step
