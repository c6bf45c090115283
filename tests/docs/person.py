"""A person at the desk: reads the terminal, moves the sticks as told, and presses keys."""

import math
import os
import re
import select
import shlex
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from pathlib import Path

FULL, REST_S, SHORT_S = 32000, 0.8, 0.05
SIDES = {"LEFT": "left", "RIGHT": "right"}
OTHER = {"left": "right", "right": "left"}
PATIENCE_S = 400.0

DESK = Path(__file__).with_name("desk")
"""With this in its path, a process and all that it starts have two sticks."""

TOLD = re.compile(
    r"push the (?P<push>LEFT|RIGHT) stick (?P<where>to the RIGHT|TOWARDS you)"
    r"|(?P<let>let go of it)\s*[\r\n]"
    r"|move the (?P<round>LEFT|RIGHT) stick round"
    r"|pull the trigger of the (?P<pull>LEFT|RIGHT) stick"
    r"|move the (?P<ends>LEFT|RIGHT) stick to all its ends"
    r"|(?P<waits>space to start)"
    r"|(?P<block>Block 1 began)"
)


class Person:
    """Sits at a terminal until the program in it ends."""

    def __init__(self, command: str, folder: Path, environment: Mapping[str, str]) -> None:
        pipe = folder / "hands"
        if not pipe.exists():
            os.mkfifo(pipe)
        self._hands = os.open(pipe, os.O_RDWR)
        self._terminal, theirs = os.openpty()
        program, *words = shlex.split(command)
        if program == "python":
            program, *words = words[1:]
        self._process = subprocess.Popen(
            [sys.executable, "-m", program, *words],
            cwd=folder,
            env={**environment, "HANDS": str(pipe), "COLUMNS": "300", "PYTHONPATH": str(DESK)},
            stdin=theirs, stdout=theirs, stderr=theirs, start_new_session=True,
        )  # fmt: skip
        os.close(theirs)
        self.read, self._heard = "", 0

    def sit(self) -> int:
        """Do what is said until the program ends; return its exit code."""
        deadline = time.monotonic() + PATIENCE_S
        doing: Iterator[float] = iter(())
        try:
            while self._process.poll() is None:
                assert time.monotonic() < deadline, f"it goes on and on:\n{self.read}"
                pause = next(doing, None)
                if pause is None and (told := self._told()):
                    self._heard, doing = told.end(), self._movement(told)
                self._look(0.05 if pause is None else pause)
            self._look(0.0)
            return self._process.returncode
        finally:
            if self._process.poll() is None:
                self._process.kill()
                self._process.wait()
            os.close(self._terminal)
            os.close(self._hands)

    def _told(self) -> re.Match[str] | None:
        """Return what is to be done next."""
        return TOLD.search(self.read, self._heard)

    def _look(self, seconds: float) -> None:
        while select.select([self._terminal], [], [], seconds)[0]:
            try:
                self.read += os.read(self._terminal, 65536).decode(errors="replace")
            except OSError:  # the other end is closed: the program has ended
                return
            seconds = 0.0

    def _move(self, side: str, axis: int, raw: float) -> None:
        os.write(self._hands, f"{side} {axis} {round(raw)}\n".encode())

    def _trigger(self, side: str) -> Iterator[float]:
        yield 0.5  # it must have been seen at rest
        os.write(self._hands, f"{side} trigger 1\n".encode())
        yield 0.5
        os.write(self._hands, f"{side} trigger 0\n".encode())

    def _movement(self, told: re.Match[str]) -> Iterator[float]:
        """Move as told; yield how long to wait after each movement, in seconds."""
        if told["waits"]:
            os.write(self._terminal, b" ")
        elif told["block"]:
            yield 2.0
            os.write(self._terminal, b"e")
        elif side := SIDES.get(told["push"]):
            self._move(side, 0 if "RIGHT" in told["where"] else 1, FULL)
        elif told["let"]:
            for side in OTHER:
                self._move(side, 0, 0)
                self._move(side, 1, 0)
        else:
            yield from self._exercise(told)

    def _exercise(self, told: re.Match[str]) -> Iterator[float]:
        if side := SIDES.get(told["round"]):
            yield from self._round(side)
        elif side := SIDES.get(told["pull"]):
            yield from self._trigger(side)
        elif side := SIDES.get(told["ends"]):
            for axis in range(4):
                for raw in (FULL, -FULL, 0):
                    self._move(side, axis, raw)
                    yield SHORT_S
            yield REST_S
            yield from self._trigger(OTHER[side])

    def _round(self, side: str) -> Iterator[float]:
        """Go round until something else is said, or the look is over."""
        for step in range(3000):  # a long time, however busy the computer is
            if self._told():
                return
            angle = step / 50
            # A circle in a square: the edge of a stick is reached on all sides.
            for axis, part in enumerate((math.cos(angle), math.sin(angle))):
                self._move(side, axis, max(-FULL, min(FULL, 1.3 * FULL * part)))
            yield 0.005
