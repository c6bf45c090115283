"""Jobs: ``labcrane`` commands that the page starts, each with its line, its output and a stop.

A command writes to a file, not to a pipe: a session that runs goes on if the start page ends.
"""

import os
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from labcrane.errors import ProtocolError

INTERRUPT = getattr(signal, "CTRL_BREAK_EVENT", signal.SIGINT)
"""What Windows has instead of the interrupt for a process of its own."""

MOST_SHOWN = 200_000
"""Characters of output that a page gets at once."""


@dataclass(frozen=True)
class Option:
    """An argument or an option of a command, as its help has it.

    Attributes
    ----------
    flag
        As typed: ``--participant``; empty for an argument.
    off
        What switches a flag off that is on by default.
    kind
        ``flag``, ``text`` or ``many``.
    """

    name: str
    flag: str
    off: str
    kind: str
    help: str
    required: bool


@dataclass(frozen=True)
class OfferedCommand:
    """A command that the page offers."""

    name: str
    section: str
    help: str
    options: Sequence[Option]

    def words(self, given: Mapping[str, Any]) -> list[str]:
        """Return the command's words with the values that were given.

        Raises
        ------
        ProtocolError
            An option is unknown, or one that is required is missing.
        """
        known = {each.name: each for each in self.options}
        if unknown := given.keys() - known.keys():
            raise ProtocolError(f"labcrane {self.name} has no option {sorted(unknown)[0]!r}")
        words, arguments = self.name.split(), []
        for name, option in known.items():
            value = given.get(name)
            if value in (None, "", []):
                if option.required:
                    raise ProtocolError(f"labcrane {self.name} needs {option.flag or option.name}")
            elif option.kind == "flag":
                words += [option.flag if value else option.off] if value or option.off else []
            else:
                for one in _words(value) if option.kind == "many" else [str(value)]:
                    words += [f"{option.flag}={one}"] if option.flag else []
                    arguments += [] if option.flag else [one]
        return [*words, *(["--"] if any(a.startswith("-") for a in arguments) else []), *arguments]


@dataclass
class Job:
    """A command that was started."""

    number: int
    words: Sequence[str]
    folder: Path
    log: Path
    begun: float = field(default_factory=time.time)
    _process: subprocess.Popen[bytes] = field(init=False)

    def __post_init__(self) -> None:
        environment = {**os.environ, "PYTHONUNBUFFERED": "1", "COLUMNS": "72"}
        with self.log.open("wb") as out:
            self._process = subprocess.Popen(  # noqa: S603 - labcrane itself, without a shell
                [sys.executable, "-P", "-m", "labcrane", *self.words],
                cwd=self.folder,
                stdin=subprocess.DEVNULL,
                stdout=out,
                stderr=subprocess.STDOUT,
                env=environment,
                **_of_its_own(),
            )

    @property
    def line(self) -> str:
        """The line that does the same in a terminal."""
        return shlex.join(["labcrane", *self.words])

    def shown(self) -> dict[str, Any]:
        """Return the line, what was printed, and the exit status once there is one."""
        return {
            "number": self.number,
            "line": self.line,
            "output": self.log.read_text(encoding="utf-8", errors="replace")[-MOST_SHOWN:],
            "status": self._process.poll(),
        }

    @property
    def runs(self) -> bool:
        """Whether the command has not ended."""
        return self._process.poll() is None

    def stop(self) -> None:
        """Interrupt the command, as Ctrl-C does in a terminal."""
        if self.runs:
            self._process.send_signal(INTERRUPT)

    def wait(self, seconds: float) -> int:
        """Return the exit status.

        Raises
        ------
        subprocess.TimeoutExpired
            It takes longer.
        """
        return self._process.wait(seconds)


def _words(text: str) -> list[str]:
    try:
        return shlex.split(text)
    except ValueError as error:
        raise ProtocolError(f"{text!r} cannot be split into words: {error}") from error


def _of_its_own() -> dict[str, Any]:
    """Keep Ctrl-C of the start page's terminal from the commands that run."""
    if sys.platform == "win32":
        return {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP}
    else:  # noqa: RET505 - mypy judges each platform by itself
        return {"start_new_session": True}
