"""Handle of one feedback process, which is kept running as the protocol specifies."""

import time
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Literal

from labcrane.feedback.config import FeedbackConfig
from labcrane.processes.handle import Patience, ProcessHandle
from labcrane.session.commands import FeedbackLost, FeedbackReady

MODULE = "labcrane.feedback.process"

START_S = 60.0
"""How long a feedback process may be silent until it presents: windows, sound servers and a first
picture take their time, most of all on a busy computer."""

SILENT_S = 3.0
"""A process that presents and has not reported for so long hangs, and is killed."""

WORKED_S = 30.0
"""So long it is to present until its failures are no longer counted as in a row."""

STOP_S = 5.0
"""How long it may take to stop when told to."""

ATTEMPTS = 3
"""After so many starts in a row without a presented frame, it is left out."""


class FeedbackHandle:
    """Starts a feedback process, finds out when it dies or hangs, and starts it again.

    Attributes
    ----------
    given_up
        Whether it is left out: it is started no more, unless :meth:`again` asks for it.
    ready
        Whether it could present: its windows and devices are open.
    facts
        Facts that it reports once it is ready: renderer, device, delay.
    presented
        How many frames the present process has presented.
    sends
        The descriptions of its streams.
    """

    def __init__(
        self, order: FeedbackConfig, policy: Literal["restart", "continue", "pause"]
    ) -> None:
        self._order = order
        self.given_up = False
        self._attempts = 1 if policy == "continue" else ATTEMPTS
        patience = Patience(START_S, SILENT_S, STOP_S, restarts=self._attempts - 1)
        self._process = ProcessHandle(MODULE, f"feedback {order.name}", patience, self._take)
        self._begin_anew()
        self._process.start(order.as_json())

    def _begin_anew(self) -> None:
        self.ready = False
        self._told = False
        self._failed: str | None = None
        self.facts = ""
        self.presented = 0
        self.sends: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """The protocol's name for it."""
        return self._order.name

    @property
    def failure(self) -> str | None:
        """Return why the present process failed, in words; None while all is well."""
        why = self._process.failure
        return self._failed or why

    def offer(self, streams: Mapping[str, str]) -> None:
        """Tell it the session's streams by their descriptions: it need not search for them."""
        self._order = replace(self._order, streams=streams)
        self._process.tell(streams)

    def watch(self) -> list[FeedbackLost | FeedbackReady]:
        """Check the process; return what to report to the session."""
        if self.given_up:
            return []
        if (why := self.failure) is not None:
            return self._replace(why)
        if self._process.ready and not self._told:
            self._told = True
            self._since = time.monotonic()
            return [FeedbackReady(self.name, self.facts)]
        if self._told and time.monotonic() - self._since > WORKED_S:
            self._process.worked()
        return []

    def again(self) -> None:
        """Start it again after it was left out; nothing while it is not."""
        if self.given_up:
            self.given_up = False
            self._begin_anew()
            self._process.start_anew(self._order.as_json())

    def stop(self) -> None:
        """Let it close its windows and devices."""
        self._process.stop()

    def _replace(self, why: str) -> list[FeedbackLost | FeedbackReady]:
        self._process.kill()
        why = self._failed or why  # its last reports
        self._begin_anew()
        self.given_up = not self._process.restart(self._order.as_json())
        attempt = 0 if self.given_up else self._process.fruitless + 1
        return [FeedbackLost(self.name, why, self.given_up, attempt, self._attempts)]

    def _take(self, message: Mapping[str, Any]) -> None:
        self.presented = message.get("beat", self.presented)
        self._failed = message.get("failed", self._failed)
        self.sends = tuple(message.get("sends", self.sends))
        if message.get("ready"):
            self.facts = ", ".join(f"{name} {value}" for name, value in message["facts"].items())
            self.ready = True
        if message.get("presents"):
            self._process.ready = True  # from now on it is to report all the time
