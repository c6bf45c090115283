"""The session as a process of its own, talking to its launcher over one pipe.

The pipe carries commands to the session, and events and how it ended from it, as pickled records.
"""

import queue
import signal
import threading
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path

from labcrane.core.records import Event
from labcrane.errors import LabcraneError
from labcrane.protocol.study import load
from labcrane.registry.registry import discover
from labcrane.session.commands import Command, Order
from labcrane.session.resume import Policy
from labcrane.session.session import Visit, record


@dataclass(frozen=True, slots=True)
class SessionConfig:
    """What a session process is told: a visit by the names of things, so that it can be sent.

    Attributes
    ----------
    feedback
        Whether the launcher starts the views and sounds.
    """

    protocol: Path
    participant: str
    session: int
    data: Path
    simulated: bool = False
    pilot: bool = False
    resumed: bool = False
    policy: Policy | None = None
    feedback: bool = True

    def visit(self) -> Visit:
        """Load the study and return the visit."""
        return Visit(
            load(self.protocol, discover(study=self.protocol)),
            self.participant,
            self.session,
            self.data,
            simulated=self.simulated,
            pilot=self.pilot,
            resumed=self.resumed,
            policy=self.policy,
            feedback=self.feedback,
        )


@dataclass(frozen=True, slots=True)
class Ended:
    """The last thing a session process says; ``error`` is None when it ran to its end."""

    error: LabcraneError | None = None


class PipeConsole:
    """The launcher at the other end of a pipe.

    A thread sends, so that a launcher that does not read never makes the loop wait. When the
    launcher is gone the session ends: nobody could stop it any more.
    """

    def __init__(self, pipe: Connection) -> None:
        self._pipe = pipe
        self._alone = False
        self._outgoing: queue.SimpleQueue[Event | Ended] = queue.SimpleQueue()
        self._sender = threading.Thread(target=self._send, name="to-launcher", daemon=True)
        self._sender.start()

    def commands(self) -> list[Command]:
        given: list[Command] = []
        if self._alone:
            return given
        try:
            while self._pipe.poll():
                given.append(self._pipe.recv())
        except (EOFError, OSError):
            self._alone = True
            given += [Command(Order.NOTE, "the launcher is gone"), Command(Order.END)]
        return given

    def report(self, event: Event) -> None:
        self._outgoing.put(event)

    def end(self, ended: Ended) -> None:
        """Say how the session ended, after everything else, and wait until it is sent."""
        self._outgoing.put(ended)
        self._sender.join()

    def _send(self) -> None:
        while True:
            message = self._outgoing.get()
            try:
                self._pipe.send(message)
            except OSError:
                return  # the launcher is gone; the record does not need it
            if isinstance(message, Ended):
                return


def serve(order: SessionConfig, pipe: Connection) -> None:
    """Run a session; the process's main function."""
    # An interrupt from the keyboard reaches the launcher too, which ends the session in order.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    console = PipeConsole(pipe)
    console.end(_ended(lambda: record(order.visit(), console)))


def _ended(run: Callable[[], None]) -> Ended:
    try:
        run()
    except LabcraneError as error:
        return Ended(error)
    return Ended()
