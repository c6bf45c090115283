"""The session as a process of its own, which a launcher starts and hears.

To the session go messages, each JSON of a declared size; from it come events and how it ended, as
records.
"""

import importlib
import pickle
import queue
import signal
import sys
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from labcrane.core.records import Event
from labcrane.errors import LabcraneError
from labcrane.processes.parent import Parent
from labcrane.session.commands import (
    Command,
    LauncherGone,
    Message,
    MessageError,
    Order,
    StreamOffered,
    decode,
)
from labcrane.session.session import record
from labcrane.streams.newest import offer

MOST_A_TICK = 16
"""Orders taken up in one tick; what else has come waits for the next."""


@dataclass(frozen=True, slots=True)
class SessionEnded:
    """The last thing a session process says; ``error`` is None when it ran to its end."""

    error: LabcraneError | None = None


@dataclass(frozen=True, slots=True)
class Offered:
    """Said when the session's streams are there: their descriptions by name."""

    streams: Mapping[str, str]


class ParentConsole:
    """The launcher as the session sees it.

    Neither a launcher that does not read, nor one that stops in the middle of a message, blocks the
    loop. When the launcher is gone the session ends, because no person could stop it any more.
    """

    def __init__(self, parent: Parent) -> None:
        self._parent = parent
        self._incoming: queue.SimpleQueue[Message] = queue.SimpleQueue()
        threading.Thread(target=self._receive, name="from-launcher", daemon=True).start()

    def commands(self) -> list[Message]:
        given: list[Message] = []
        while len(given) < MOST_A_TICK and not self._incoming.empty():  # not in the usual tick
            given.append(self._incoming.get_nowait())
        return given

    def report(self, event: Event) -> None:
        self._parent.tell(event)

    def offer(self, streams: Mapping[str, str]) -> None:
        """Announce the streams, so that no process on this computer searches for them."""
        self._parent.tell(Offered(streams))

    def end(self, ended: SessionEnded) -> None:
        """Say how the session ended, after everything else, and wait until it is sent."""
        self._parent.tell(ended)
        self._parent.close(patience_s=None)

    def _receive(self) -> None:
        for line in self._parent.incoming():
            try:
                message = decode(line)
                if isinstance(message, StreamOffered):
                    offer(message.description)
                else:
                    self._incoming.put(message)
            except MessageError as error:
                self._incoming.put(Command(Order.DENIED, str(error)))
        self._incoming.put(LauncherGone())


def main() -> int:
    """Run one session; return the process's exit status."""
    # An interrupt from the keyboard reaches the launcher, which ends the session in order.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = Parent()
    if (visit := parent.order()) is None:
        return 0
    console = ParentConsole(parent)
    # Pickled by the launcher: it loads the study, here and not in a thread that reads.
    console.end(_ended(lambda: record(pickle.loads(visit), console, console.offer)))  # noqa: S301
    return 0


def _ended(run: Callable[[], None]) -> SessionEnded:
    try:
        run()
    except LabcraneError as error:
        return SessionEnded(error)
    return SessionEnded()


if __name__ == "__main__":
    # What it sends is unpickled by the name of this module, which is not __main__.
    sys.exit(importlib.import_module("labcrane.launcher.session_process").main())
