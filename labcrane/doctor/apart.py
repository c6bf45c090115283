"""Process of its own for every examination: one that hangs or crashes is a finding.

A folder on a server that does not answer, a driver that stands still, a library that takes its
process with it: the doctor says what did so, and where, and goes on.
"""

import faulthandler
import importlib
import os
import re
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path
from typing import Any, Protocol

from labcrane.core.findings import Finding, Verdict
from labcrane.processes.handle import Patience, ProcessHandle
from labcrane.processes.parent import Parent

MODULE = "labcrane.doctor.apart"

WAIT_S = 30.0
"""How long an examination may take."""

START_S = 60.0
"""How much longer a process may take that has to start first, on a busy computer too."""

END_S = 5.0
"""How long the doctor waits for the end of a process that it has killed; none can be that waits
for a disk without an end."""

TIMEOUT = "Timeout ("
"""How faulthandler begins when the time of an examination is over."""

Tell = Callable[[str], None]


class Examination(Protocol):
    """What can be examined in another process: it is pickled."""

    @property
    def what(self) -> str:
        """What is looked at, for ``looking at ... did not answer``."""

    @property
    def fix(self) -> str:
        """What to do when it does not answer."""

    def prepared(self) -> Callable[[Tell | None], Iterable[Finding]]:
        """Get ready, which is not timed; return what examines."""


@dataclass(frozen=True, slots=True)
class Call:
    """An examination that is a function of a module, and what it is called with."""

    what: str
    fix: str
    function: Callable[..., Iterable[Finding]]
    arguments: tuple[Any, ...] = ()

    def prepared(self) -> Callable[[Tell | None], Iterable[Finding]]:
        """Return the function."""
        return lambda _: self.function(*self.arguments)


@dataclass(frozen=True, slots=True)
class ExaminationConfig:
    """What the process of an examination is told.

    Attributes
    ----------
    examination
        What to do.
    asks
        Whether a person is there, who is told what to move.
    complaints
        The file that takes what is written to the standard error.
    wait_s
        How long the examination may take.
    """

    examination: Examination
    asks: bool
    complaints: Path
    wait_s: float


def examine(
    examination: Examination, *, wait_s: float | None = None, asks: bool = False
) -> Sequence[Finding]:
    """Return what an examination finds in a process of its own, or how it failed.

    Parameters
    ----------
    examination
        What to do; it is pickled.
    wait_s
        How long it may take, by default ``WAIT_S``.
    asks
        Whether a person is there, who is told what to move.
    """
    # A folder: Windows lets no second process open a temporary file that is open here.
    with tempfile.TemporaryDirectory(prefix="labcrane-doctor-") as folder:
        complaints = Path(folder) / "complaints"
        complaints.touch()
        return _examine(
            ExaminationConfig(examination, asks, complaints, WAIT_S if wait_s is None else wait_s)
        )


def _examine(order: ExaminationConfig) -> Sequence[Finding]:
    examination, wait_s = order.examination, order.wait_s
    process = ProcessHandle(MODULE, f"examine {examination.what}", Patience(stop_s=1.0))
    process.start(order)
    ends = time.monotonic() + wait_s + START_S
    try:
        found = None
        while found is None and not process.ended and time.monotonic() < ends:
            process.wait(ends - time.monotonic())
            found = _taken(process)
        found = _taken(process) if found is None else found
        code = process.exit_code
    finally:
        ending = threading.Thread(target=process.stop, name=f"end {process.name}", daemon=True)
        ending.start()
        ending.join(END_S)
    if found is not None:
        return found
    if code is None:
        return [_fault(examination, f"did not answer within {wait_s + START_S:g} s")]
    text = order.complaints.read_text(encoding="utf-8", errors="replace")
    if TIMEOUT in text:
        return [_fault(examination, f"did not answer within {wait_s:g} s{_stuck(text)}")]
    *_, last = ["", *text.splitlines()]
    why = f"; the last it said was {last.strip()!r}" if last else ""
    return [_fault(examination, f"ended its process with exit code {code}{why}")]


def _taken(process: ProcessHandle) -> Sequence[Finding] | None:
    """Show what is for the person who moves things; return the findings once they have come."""
    found = None
    for message in process.messages():
        if isinstance(message, str):
            print(f"  {message}", flush=True)  # noqa: T201 - to the person who moves things
        else:
            found = message
    return found


def _fault(examination: Examination, what: str) -> Finding:
    return Finding(Verdict.FAIL, f"looking at {examination.what} {what}", examination.fix)


FRAME = re.compile(r'^  File "(?P<path>.+)", line (?P<line>\d+) in (?P<name>.+)$', re.MULTILINE)


def _stuck(complaints: str) -> str:
    """Return where an examination has stood still, as faulthandler wrote it at the end of its time.

    What hangs is most often a library; which call of the plugin's led there says more.
    """
    *_, main = complaints.rpartition("(most recent call first):")
    calls = list(takewhile(lambda call: not _ours(call["path"]), FRAME.finditer(main)))
    if not calls:
        return ""
    inner, *outer = calls
    said = f"; it stood still in {inner['name']}() ({Path(inner['path']).name}:{inner['line']})"
    here = Path(inner["path"]).parent
    for call in outer:
        if Path(call["path"]).parent != here:
            place = f"{Path(call['path']).name}:{call['line']}"
            return f"{said}, called by {call['name']}() ({place})"
    return said


def _ours(path: str) -> bool:
    """Whether a file is this one, also when the process has imported it from another place."""
    return Path(path).parts[-3:] == Path(__file__).parts[-3:]


def main() -> int:
    """Examine once; return the process's exit status."""
    parent = Parent()
    order: ExaminationConfig | None = parent.order()
    if order is None:
        return 0
    # Sound libraries fill the terminal with what they did not find; it is kept for a crash.
    with order.complaints.open("a", encoding="utf-8") as file:
        os.dup2(file.fileno(), sys.stderr.fileno())
    examination = order.examination
    examines = examination.prepared()
    # Even what hangs in C and lets no Python run is seen by this, and ended.
    faulthandler.dump_traceback_later(order.wait_s, exit=True, file=sys.stderr)
    try:
        found = list(examines(parent.tell if order.asks else None))
    except Exception as error:  # noqa: BLE001 - a plugin's look can raise anything
        found = [_fault(examination, f"raised {type(error).__name__}: {error}")]
    parent.tell(found)
    parent.close()
    return 0


if __name__ == "__main__":
    # What it sends is unpickled by the name of this module, which is not __main__.
    sys.exit(importlib.import_module(MODULE).main())
