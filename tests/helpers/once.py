"""What is dear to make is made once in a run of tests, and copied for each of its processes."""

import os
import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

RUN_FOLDER = "LABCRANE_TESTS_FOLDER"
"""Names the folder that the processes of a run share."""


def made_once(name: str, make: Callable[[Path], object], place: Path) -> Path:
    """Return a copy, in ``place``, of a folder that ``make`` has filled once in this run.

    The first process that asks makes it, while others that ask wait. Each has a copy, so that its
    tests may write there.

    Parameters
    ----------
    name
        Of the folder; the same in all processes, and of one thing only.
    make
        Fills the empty folder that it is given. What it leaves must not name its own place.
    place
        An empty folder of the process.
    """
    shared = Path(os.environ[RUN_FOLDER]) / "once"
    shared.mkdir(exist_ok=True)
    made = shared / f"{name}.made"
    with _locked(shared / f"{name}.lock"):
        if not made.exists():
            shutil.rmtree(shared / name, ignore_errors=True)  # of a process that died over it
            (shared / name).mkdir()
            make(shared / name)
            made.touch()
    return Path(shutil.copytree(shared / name, place / name))


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    if sys.platform == "win32":  # where tests run in one process
        yield
        return
    import fcntl

    with path.open("w", encoding="utf-8") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield
