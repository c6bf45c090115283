"""Messages between processes: an inbox for what comes, and both ways through a pipe.

Threads read and write the pipes, so that neither side ever waits for the other.
"""

import pickle
import queue
import threading
from collections.abc import Iterator
from contextlib import suppress
from typing import IO, Any, Generic, TypeVar

MessageT = TypeVar("MessageT")


class Inbox(Generic[MessageT]):
    """Messages from a thread, until they are read."""

    def __init__(self) -> None:
        self._incoming: queue.SimpleQueue[MessageT] = queue.SimpleQueue()
        self._news = threading.Event()

    def put(self, message: MessageT) -> None:
        """Put in a message, and wake up waiting threads."""
        self._incoming.put(message)
        self._news.set()

    def wake(self) -> None:
        """Wake up waiting threads, without a message."""
        self._news.set()

    def messages(self) -> list[MessageT]:
        """Return the messages since the last call, without waiting."""
        self._news.clear()
        found = []
        with suppress(queue.Empty):
            while True:
                found.append(self._incoming.get_nowait())
        return found

    def first(self) -> MessageT | None:
        """Return the message that waits longest; None when none does."""
        with suppress(queue.Empty):
            return self._incoming.get_nowait()
        return None

    def wait(self, seconds: float | None = None) -> bool:
        """Wait for a message, or to be woken up; whether there was either."""
        return self._news.wait(seconds)


def received(pipe: IO[bytes]) -> Iterator[Any]:
    """Yield the messages from a pipe's other end, until that is closed or its process has died."""
    while True:
        try:
            message = pickle.load(pipe)  # noqa: S301 - our own child, or our own parent
        except (EOFError, pickle.UnpicklingError, OSError, ValueError):
            return  # it ended, perhaps in the middle of a message
        yield message


def send(outgoing: "queue.SimpleQueue[bytes | None]", pipe: IO[bytes]) -> None:
    """Write what is put into ``outgoing``, up to None, or until the other end is closed."""
    with suppress(OSError):
        while (message := outgoing.get()) is not None:
            pipe.write(message)
            pipe.flush()
