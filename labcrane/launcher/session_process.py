"""The session as a process of its own, talking to its launcher over one pipe.

The pipe carries messages to the session, as JSON of a declared size, and events and how it ended
from it, as pickled records.
"""

import pickle
import queue
import signal
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from labcrane.core.records import Event
from labcrane.errors import LabcraneError
from labcrane.processes.pipe import PipeEnd
from labcrane.session.commands import (
    MOST_BYTES,
    Command,
    LauncherGone,
    Message,
    MessageError,
    Order,
    decode,
)
from labcrane.session.session import record

MOST_A_TICK = 16
"""Orders taken up in one tick; what else has come waits for the next."""


@dataclass(frozen=True, slots=True)
class Ended:
    """The last thing a session process says; ``error`` is None when it ran to its end."""

    error: LabcraneError | None = None


@dataclass(frozen=True, slots=True)
class Offered:
    """Said when the session's streams are there: their descriptions by name."""

    streams: Mapping[str, str]


class PipeConsole:
    """The launcher at the other end of a pipe.

    One thread sends and one receives, so that a launcher that does not read, or stops in the
    middle of a message, never makes the loop wait. When the launcher is gone the session ends:
    nobody could stop it any more.
    """

    def __init__(self, pipe: PipeEnd) -> None:
        self._pipe = pipe
        self._incoming: queue.SimpleQueue[Message] = queue.SimpleQueue()
        self._outgoing: queue.SimpleQueue[Event | Offered | Ended] = queue.SimpleQueue()
        self._sender = threading.Thread(target=self._send, name="to-launcher", daemon=True)
        self._sender.start()
        threading.Thread(target=self._receive, name="from-launcher", daemon=True).start()

    def commands(self) -> list[Message]:
        given: list[Message] = []
        while len(given) < MOST_A_TICK and not self._incoming.empty():  # not in the usual tick
            given.append(self._incoming.get_nowait())
        return given

    def report(self, event: Event) -> None:
        self._outgoing.put(event)

    def offer(self, streams: Mapping[str, str]) -> None:
        """Say which streams there are, so that nobody on this computer searches for them."""
        self._outgoing.put(Offered(streams))

    def end(self, ended: Ended) -> None:
        """Say how the session ended, after everything else, and wait until it is sent."""
        self._outgoing.put(ended)
        self._sender.join()

    def _receive(self) -> None:
        while True:
            try:
                self._incoming.put(decode(self._pipe.recv_bytes(MOST_BYTES)))
            except MessageError as error:
                self._incoming.put(Command(Order.DENIED, str(error)))
            except (EOFError, OSError):
                self._incoming.put(LauncherGone())
                return

    def _send(self) -> None:
        while True:
            message = self._outgoing.get()
            try:
                self._pipe.send(message)
            except OSError:
                return  # the launcher is gone; the record does not need it
            if isinstance(message, Ended):
                return


def serve(visit: bytes, pipe: PipeEnd) -> None:
    """Run a session; the process's main function. ``visit`` is pickled: it loads the study."""
    # An interrupt from the keyboard reaches the launcher too, which ends the session in order.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    console = PipeConsole(pipe)
    # Whoever wrote it is the launcher.
    console.end(_ended(lambda: record(pickle.loads(visit), console, console.offer)))  # noqa: S301


def _ended(run: Callable[[], None]) -> Ended:
    try:
        run()
    except LabcraneError as error:
        return Ended(error)
    return Ended()
