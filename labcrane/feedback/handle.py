"""Keeps one feedback process running, as the protocol says."""

import json
import subprocess
import sys
import threading
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, Literal

from labcrane.feedback.config import FeedbackConfig
from labcrane.session.commands import Command, Order

READY_S = 60.0
"""How long a feedback process may take until it is ready: windows and sound servers are slow."""

SILENT_S = 3.0
"""A process that has not been heard of for so long hangs, and is killed."""

STOP_S = 5.0
"""How long it may take to stop when told to."""

ATTEMPTS = 3
"""After so many starts in a row without one frame presented, it is left out."""


@dataclass
class Life:
    """One process and what it has said; read by the keeper while a thread listens."""

    process: "subprocess.Popen[str]"
    heard: float
    ready: bool = False
    presents: bool = False
    facts: str = ""
    failed: str | None = None
    presented: int = 0
    listener: threading.Thread = field(default_factory=threading.Thread)

    def hang_up(self) -> None:
        """Close its input, which tells it to stop."""
        if self.process.stdin is not None:
            with suppress(BrokenPipeError):  # it may die this very moment
                self.process.stdin.close()


class FeedbackHandle:
    """Starts a feedback process, finds out when it dies or hangs, and starts it again.

    Attributes
    ----------
    given_up
        Whether it has been left out.
    """

    def __init__(
        self, order: FeedbackConfig, policy: Literal["restart", "continue", "pause"]
    ) -> None:
        self._order = order
        self._policy = policy
        self._fruitless = 0
        self._told = False
        self.given_up = False
        self._life = self._start()

    @property
    def name(self) -> str:
        """The protocol's name for it."""
        return self._order.name

    @property
    def ready(self) -> bool:
        """Whether it could present: its windows and devices are open."""
        return self._life.ready

    @property
    def facts(self) -> str:
        """What it has said of itself since it is ready: renderer, device, delay."""
        return self._life.facts

    @property
    def presented(self) -> int:
        """How many frames the present process has presented."""
        return self._life.presented

    @property
    def failure(self) -> str | None:
        """Return why the present process is of no use, in words; None while all is well."""
        life = self._life
        code = life.process.poll()
        if code is not None or life.failed is not None:
            return life.failed or f"its process ended with exit code {code}"
        silent = time.monotonic() - life.heard
        if silent > (SILENT_S if life.ready else READY_S):
            return f"it has not been heard of for {silent:.0f} s"
        return None

    def watch(self) -> list[Command]:
        """Look after the process; return what the session is to be told."""
        if self.given_up:
            return []
        if (why := self.failure) is not None:
            return self._replace(why)
        if self._life.presents and not self._told:
            self._told = True
            self._fruitless = 0
            return [Command(Order.MENDED, f"{self.name}: {self.facts}")]
        return []

    def stop(self) -> None:
        """Let it close its windows and devices."""
        process = self._life.process
        self._life.hang_up()
        try:
            process.wait(STOP_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        self._life.listener.join()

    def _replace(self, why: str) -> list[Command]:
        life = self._life
        life.process.kill()
        life.process.wait()
        life.hang_up()
        self._fruitless = 0 if life.presents else self._fruitless + 1
        if self._policy == "continue" or self._fruitless >= ATTEMPTS:
            self.given_up = True
            return [Command(Order.LEFT_OUT, f"{self.name}: {why}; it is left out")]
        self._told = False
        self._life = self._start()
        return [Command(Order.FAILED, f"{self.name}: {why}")]

    def _start(self) -> Life:
        process = subprocess.Popen(
            [sys.executable, "-m", "labcrane.feedback.process"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            start_new_session=True,  # it ends when told to, not when a key is pressed
        )
        life = Life(process, time.monotonic())
        life.listener = threading.Thread(target=_listen, args=(life,), daemon=True)
        life.listener.start()
        if process.stdin is None:
            raise AssertionError("it is started with a pipe")
        try:
            process.stdin.write(self._order.as_json() + "\n")
            process.stdin.flush()
        except BrokenPipeError:
            pass  # it died at once; its exit code says how
        return life


def _listen(life: Life) -> None:
    if life.process.stdout is None:
        raise AssertionError("it is started with a pipe")
    with life.process.stdout as lines:
        for line in lines:
            _take(life, json.loads(line))


def _take(life: Life, message: Mapping[str, Any]) -> None:
    life.heard = time.monotonic()
    life.presented = message.get("beat", life.presented)
    life.failed = message.get("failed", life.failed)
    if message.get("ready"):
        life.facts = ", ".join(f"{name} {value}" for name, value in message["facts"].items())
        life.ready = True
    if message.get("presents"):
        life.presents = True
