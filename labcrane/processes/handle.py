"""Handle of a child process: starts it, exchanges messages with it, restarts it, ends it.

A child is a module run by ``python -m``. It receives its order and messages on its standard input
and answers on its standard output, pickled (:class:`labcrane.processes.parent.Parent` is its side).
Threads read and write, so that a child that hangs or dies never blocks this process. This works on
every system, because nothing is polled that only some of them can poll.
"""

import math
import pickle
import queue
import subprocess
import sys
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import IO, Any

from labcrane.processes.messages import Inbox, received, send
from labcrane.processes.watch_clock import WatchClock

KILLED_S = 5.0
"""How long a killed process may take to be gone: with a driver that waits, it may never be."""

LAST_S = 1.0
"""How long reading the last messages of a process that has ended may take, in seconds."""


SAFELY = ("-P",)
"""Option of Python: modules are not searched in the current folder, which may contain the files of
strangers, such as a ``json.py``."""


@dataclass(frozen=True, slots=True)
class Patience:
    """How long a child may take, in seconds.

    Attributes
    ----------
    start_s
        Until it is ready, without having been heard of.
    silent_s
        Without having been heard of, once it is ready.
    stop_s
        To end when it is asked to; then it is killed.
    restarts
        How many starts in a row may come to nothing before it is left out.
    """

    start_s: float = math.inf
    silent_s: float = math.inf
    stop_s: float = 5.0
    restarts: float = math.inf


@dataclass
class _Life:
    """One process, and its messages."""

    process: "subprocess.Popen[bytes]"
    input: IO[bytes]
    output: IO[bytes]
    heard: float
    outgoing: "queue.SimpleQueue[bytes | None]" = field(default_factory=queue.SimpleQueue)
    threads: list[threading.Thread] = field(default_factory=list)


class ProcessHandle:
    """A child process that is started, and perhaps started again.

    Parameters
    ----------
    module
        Module that it runs; it finds its parent by :class:`labcrane.processes.parent.Parent`.
    name
        Its name for people.
    patience
        How long it may take for what.
    take
        Is given each message, in a thread, as it comes; without it they wait in :meth:`messages`.

    Attributes
    ----------
    ready
        Whether the present process could begin its work; set by the code that reads its messages.
    restarts
        How often it was restarted.
    fruitless
        How many restarts in a row have come to nothing so far, with the present one.
    """

    def __init__(
        self,
        module: str,
        name: str,
        patience: Patience = Patience(),
        take: Callable[[Any], None] | None = None,
    ) -> None:
        self.name = name
        self.ready = False
        self.restarts = 0
        self._module = module
        self._patience = patience
        self._take = take
        self.fruitless = 0
        self._clock = WatchClock()
        self._inbox: Inbox[Any] = Inbox()
        self._life: _Life | None = None

    def start(self, order: object = None) -> None:
        """Start a process and send it its order; without one it waits for messages."""
        if self._life is not None:
            raise AssertionError(f"{self.name} is started once; restart starts it again")
        self._life = self._begun(order)

    @property
    def pid(self) -> int:
        """The number of the present process."""
        return self._present.process.pid

    @property
    def exit_code(self) -> int | None:
        """The exit code of the present process; None while it lives."""
        return self._present.process.poll()

    @property
    def silent_s(self) -> float:
        """For how long nothing was heard of the present process, in seconds."""
        return self._clock() - self._present.heard

    @property
    def failure(self) -> str | None:
        """Return why the present process is of no use, in words; None while all is well."""
        if (code := self.exit_code) is not None:
            self._present.threads[0].join(LAST_S)  # its last words may say why
            return f"its process ended with exit code {code}"
        silent = self.silent_s
        patience = self._patience.silent_s if self.ready else self._patience.start_s
        return f"it has not responded for {silent:.0f} s" if silent > patience else None

    def tell(self, message: object) -> None:
        """Send the process a message, without waiting; it is lost when the process has died."""
        self._present.outgoing.put(pickle.dumps(message))

    @property
    def waiting(self) -> int:
        """How many messages the process has not taken yet."""
        return self._present.outgoing.qsize()

    @property
    def ended(self) -> bool:
        """Whether the process has ended, and all that it has said is in :meth:`messages`."""
        return not self._present.threads[0].is_alive()

    def messages(self) -> list[Any]:
        """Return its messages since the last call."""
        return self._inbox.messages()

    def wait(self, seconds: float) -> bool:
        """Wait for a message or the process's end; whether there is one."""
        return self._inbox.wait(seconds)

    def worked(self) -> None:
        """Note that the present process did its work: the count of restarts begins again."""
        self.fruitless = 0

    def restart(self, order: object) -> bool:
        """End the present process and start another; False when that failed too often.

        Call it when :attr:`failure` says why.
        """
        self.kill()
        if self.fruitless >= self._patience.restarts:
            return False
        fruitless = self.fruitless + 1
        self.start_anew(order)
        self.fruitless = fruitless
        return True

    def start_anew(self, order: object) -> None:
        """Start another process once the present one is ended; the count begins again."""
        self.kill()
        self.fruitless = 0
        self.restarts += 1
        self.ready = False
        self._life = self._begun(order)

    def stop(self, patience_s: float | None = None) -> int | None:
        """Let the process end in order, and kill it when it does not; its exit code.

        None where it cannot be ended, as while its driver waits for a device: it is left.

        ``patience_s`` is how long it may take, by default as its :class:`Patience` says.
        """
        life = self._present
        life.outgoing.put(None)
        patience_s = self._patience.stop_s if patience_s is None else patience_s
        try:
            life.process.wait(patience_s if math.isfinite(patience_s) else None)
        except subprocess.TimeoutExpired:
            life.process.kill()
        return self._buried(life)

    def kill(self) -> int | None:
        """End the process at once; its exit code, or None as of :meth:`stop`."""
        life = self._present
        life.process.kill()
        life.outgoing.put(None)
        return self._buried(life)

    @property
    def _present(self) -> _Life:
        if self._life is None:
            raise AssertionError(f"{self.name} has not been started")
        return self._life

    def _begun(self, order: object) -> _Life:
        first = None if order is None else pickle.dumps(order)
        process = subprocess.Popen(  # noqa: S603 - a module of ours
            [sys.executable, *SAFELY, "-m", self._module],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            **_apart(),
        )
        if process.stdin is None or process.stdout is None:
            raise AssertionError("it is started with pipes")
        life = _Life(process, process.stdin, process.stdout, self._clock())
        if first is not None:
            life.outgoing.put(first)
        life.threads = [
            threading.Thread(target=work, args=(life,), name=f"{word} {self.name}", daemon=True)
            for work, word in ((self._hear, "hear"), (_speak, "tell"))
        ]
        for thread in life.threads:
            thread.start()
        return life

    def _hear(self, life: _Life) -> None:
        for message in received(life.output):
            life.heard = self._clock()
            (self._take or self._inbox.put)(message)
            self._inbox.wake()
        life.process.wait()
        self._inbox.wake()

    @staticmethod
    def _buried(life: _Life) -> int | None:
        try:
            code = life.process.wait(KILLED_S)
        except subprocess.TimeoutExpired:
            return None
        for thread in life.threads:
            thread.join()
        life.output.close()
        return code


def _speak(life: _Life) -> None:
    """Write the messages; close after the last one, or when the process is gone."""
    send(life.outgoing, life.input)
    with suppress(OSError):
        life.input.close()


def _apart() -> Mapping[str, Any]:
    """Return how a child is kept from the terminal's interrupts: it ends when it is asked to."""
    if sys.platform == "win32":
        apart: Mapping[str, Any] = {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP}
    else:
        apart = {"start_new_session": True}
    return apart
