"""Process of its own for every examination: one that hangs or crashes is a finding.

If a server's folder does not answer, a driver hangs, or a library crashes its process, the doctor
reports what did so, and where, and continues.

In a thread, code that hangs in C would keep the interpreter; in one process for all, the first hang
would hide the rest.
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

MODULE = "labcrane.doctor.check_process"

WAIT_S = 30.0
"""Time limit of an examination."""

START_S = 60.0
"""Additional time for the start of its process, on a busy computer too."""

END_S = 5.0
"""How long the doctor waits for the end of a killed process; a process that waits for a disk may
never end."""

TIMEOUT = "Timeout ("
"""First words of faulthandler's output at the end of an examination's time."""

Tell = Callable[[str], None]


class Examination(Protocol):
    """An examination for another process: it is pickled."""

    @property
    def what(self) -> str:
        """What is examined, for ``examining ... did not answer``."""

    @property
    def fix(self) -> str:
        """Remedy if it does not answer."""

    def prepared(self) -> Callable[[Tell | None], Iterable[Finding]]:
        """Prepare, without time limit; return the function that examines."""


@dataclass(frozen=True, slots=True)
class Call:
    """An examination by a function of a module, with its arguments."""

    what: str
    fix: str
    function: Callable[..., Iterable[Finding]]
    arguments: tuple[Any, ...] = ()

    def prepared(self) -> Callable[[Tell | None], Iterable[Finding]]:
        """Return the function."""
        return lambda _: self.function(*self.arguments)


@dataclass(frozen=True, slots=True)
class ExaminationConfig:
    """Configuration of an examination's process.

    Attributes
    ----------
    examination
        The examination.
    asks
        Whether a person is there to move things when asked.
    complaints
        The file for the standard error.
    wait_s
        Time limit of the examination.
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
        The examination; it is pickled.
    wait_s
        Its time limit, by default ``WAIT_S``.
    asks
        Whether a person is there to move things when asked.
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
    why = f"; its last output was {last.strip()!r}" if last else ""
    return [_fault(examination, f"ended its process with exit code {code}{why}")]


def _taken(process: ProcessHandle) -> Sequence[Finding] | None:
    """Print the instructions for the person; return the findings once they have come."""
    found = None
    for message in process.messages():
        if isinstance(message, str):
            print(f"  {message}", flush=True)  # noqa: T201 - to the person who moves things
        else:
            found = message
    return found


def _fault(examination: Examination, what: str) -> Finding:
    return Finding(Verdict.FAIL, f"examining {examination.what} {what}", examination.fix)


FRAME = re.compile(r'^  File "(?P<path>.+)", line (?P<line>\d+) in (?P<name>.+)$', re.MULTILINE)


def _stuck(complaints: str) -> str:
    """Return where an examination was stuck, as faulthandler wrote it at the end of its time.

    Most often a library hangs; the plugin's call that led there says more.
    """
    *_, main = complaints.rpartition("(most recent call first):")
    calls = list(takewhile(lambda call: not _ours(call["path"]), FRAME.finditer(main)))
    if not calls:
        return ""
    inner, *outer = calls
    said = f"; it was stuck in {inner['name']}() ({Path(inner['path']).name}:{inner['line']})"
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
    # Sound libraries fill the terminal with messages; they are kept in case of a crash.
    with order.complaints.open("a", encoding="utf-8") as file:
        os.dup2(file.fileno(), sys.stderr.fileno())
    examination = order.examination
    examines = examination.prepared()
    # This detects and ends even code that hangs in C and lets no Python run.
    faulthandler.dump_traceback_later(order.wait_s, exit=True, file=sys.stderr)
    try:
        found = list(examines(parent.tell if order.asks else None))
    except Exception as error:  # noqa: BLE001 - a plugin's look can raise anything
        found = [_fault(examination, f"raised {type(error).__name__}: {error}")]
    parent.tell(found)
    parent.close()
    return 0


if __name__ == "__main__":
    # Its findings are unpickled by the name of this module, which is not __main__.
    sys.exit(importlib.import_module(MODULE).main())
