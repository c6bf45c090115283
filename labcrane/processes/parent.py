"""Parent of a child process, as the child sees it: its order, what it says, whether it is there.

What is printed in the child goes to the standard error: libraries for sound and graphics print,
and the standard output is for messages to the parent.
"""

import os
import pickle
import queue
import threading
from contextlib import suppress
from typing import IO, Any

LOOK_S = 0.25


class Parent:
    """The process that started this one by a :class:`labcrane.processes.handle.ProcessHandle`.

    Threads read and write: a parent that hangs or has died never makes this process wait.

    Attributes
    ----------
    gone
        Set when it has said its last, or has died: this process is to end.
    """

    def __init__(self) -> None:
        # Copies, so that nothing at the interpreter's end waits for a thread that reads or writes.
        self._input: IO[bytes] = os.fdopen(os.dup(0), "rb")
        self._output: IO[bytes] = os.fdopen(os.dup(1), "wb")
        os.dup2(2, 1)
        self.gone = threading.Event()
        self._incoming: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._outgoing: queue.SimpleQueue[bytes | None] = queue.SimpleQueue()
        self._news = threading.Event()
        self._closed = threading.Event()
        for work in (self._hear, self._speak):
            threading.Thread(target=work, name=f"parent {work.__name__}", daemon=True).start()

    def order(self) -> Any:
        """Wait for what it says first; None when it ends without a word."""
        while not self.gone.is_set():
            try:
                return self._incoming.get(timeout=LOOK_S)
            except queue.Empty:
                continue
        with suppress(queue.Empty):  # it may have said it and gone at once
            return self._incoming.get_nowait()
        return None

    def tell(self, message: object) -> None:
        """Tell the parent something, without waiting for it."""
        self._outgoing.put(pickle.dumps(message))

    def messages(self) -> list[Any]:
        """Return what the parent has said since the last call."""
        self._news.clear()
        found = []
        with suppress(queue.Empty):
            while True:
                found.append(self._incoming.get_nowait())
        return found

    def wait(self, seconds: float) -> bool:
        """Wait for a message or the parent's end; whether there is one."""
        return self._news.wait(seconds) or self.gone.is_set()

    def close(self, patience_s: float = 5.0) -> None:
        """Wait until all that was told is on its way; call it last."""
        self._outgoing.put(None)
        self._closed.wait(patience_s)

    def _hear(self) -> None:
        with suppress(EOFError, pickle.UnpicklingError, OSError):
            while True:
                self._incoming.put(pickle.load(self._input))  # noqa: S301 - our own parent
                self._news.set()
        self.gone.set()
        self._news.set()

    def _speak(self) -> None:
        with suppress(OSError):  # the parent is gone; its end of the input says so too
            while (message := self._outgoing.get()) is not None:
                self._output.write(message)
                self._output.flush()
        self._closed.set()
