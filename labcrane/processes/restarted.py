"""Handle of a process that is started again after each failure, for as long as it is wanted."""

import math
import time
from collections.abc import Mapping
from typing import Any

from labcrane.processes.handle import Patience, ProcessHandle

PAUSE_S = 1.0
"""Between the first failure of a process and the start of the next one."""


class RestartedProcess(ProcessHandle):
    """A process that says which stream it sends (``sends``), and why it fails (``failed``).

    Parameters
    ----------
    order
        The first message to each process.
    longest_pause_s
        Each pause before a start is twice the last one, up to this.

    Attributes
    ----------
    sends
        The description of the stream of the present process.
    failures
        How many processes have failed.
    """

    def __init__(
        self,
        module: str,
        name: str,
        patience: Patience,
        order: object,
        longest_pause_s: float = PAUSE_S,
    ) -> None:
        self.sends = self._failed = ""
        self.failures = 0
        self._order = order
        self._pause_s, self._longest_pause_s = PAUSE_S, longest_pause_s
        self._again = math.inf
        self._left = False
        self._said: set[str] = set()
        super().__init__(module, name, patience, self._hear_of)
        self.start(order)

    def watch(self) -> list[str]:
        """Start it again some time after it failed; return what is new, in words."""
        fresh = [each for each in self._news() if each not in self._said]
        self._said |= {*fresh}
        return fresh

    @property
    def stuck(self) -> str:
        """The words about a process that cannot be ended."""
        return (
            f"its process {self.pid} cannot be ended, as a driver waits for its device; unplug "
            "the device, or restart the computer after the session"
        )

    def _news(self) -> list[str]:
        if self._again <= time.monotonic():
            self._again = math.inf
            self.start_anew(self._order)
        elif self._again == math.inf and (why := self.failure) is not None:
            self._left = (self.exit_code if self._left else self.kill()) is None
            if self._left:
                return [self.stuck]
            self.failures += 1
            self.ready = False
            why, self.sends, self._failed = self._failed or why, "", ""
            self._again = time.monotonic() + self._pause_s
            self._pause_s = min(2.0 * self._pause_s, self._longest_pause_s)
            return [f"failed: {why}; it is started again"]
        return []

    def _hear_of(self, message: Mapping[str, Any]) -> None:
        self.sends = message.get("sends", self.sends)
        self._failed = message.get("failed", self._failed)

    def _works(self) -> None:
        """Note that the present process does its work: the same failure is news again."""
        self.ready = True
        self._said = set()
