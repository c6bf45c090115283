"""Parent of a child process, as the child sees it: its order, what it says, whether it is there.

What is printed in the child goes to the standard error, for libraries for sound and graphics print,
and what reads the standard input finds it at its end: both are for messages.
"""

import os
import pickle
import queue
import threading
from collections.abc import Callable, Iterator
from typing import IO, Any

from labcrane.errors import LabcraneError
from labcrane.processes.messages import Inbox, received, send
from labcrane.processes.traceback import told


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
        nothing = os.open(os.devnull, os.O_RDONLY)
        os.dup2(nothing, 0)
        os.close(nothing)
        self.gone = threading.Event()
        self._inbox: Inbox[Any] = Inbox()
        self._outgoing: queue.SimpleQueue[bytes | None] = queue.SimpleQueue()
        self._closed = threading.Event()
        for work in (self._hear, self._speak):
            threading.Thread(target=work, name=f"parent {work.__name__}", daemon=True).start()

    def order(self) -> Any:
        """Wait for what it says first; None when it ends without a word."""
        while (order := self._inbox.first()) is None and not self.gone.is_set():
            self._inbox.wait()
        return self._inbox.first() if order is None else order  # it may have said it and gone

    def tell(self, message: object) -> None:
        """Tell the parent something, without waiting for it."""
        self._outgoing.put(pickle.dumps(message))

    def messages(self) -> list[Any]:
        """Return the parent's messages since the last call."""
        return self._inbox.messages()

    def wait(self, seconds: float | None = None) -> bool:
        """Wait for a message or the parent's end; whether there is one."""
        return self._inbox.wait(seconds) or self.gone.is_set()

    def incoming(self) -> Iterator[Any]:
        """Yield the parent's messages as they come, until it is gone; for a thread of its own."""
        while not self.gone.is_set():
            self._inbox.wait()
            yield from self._inbox.messages()
        yield from self._inbox.messages()

    def close(self, patience_s: float | None = 5.0) -> None:
        """Wait until all messages are sent; call it last."""
        self._outgoing.put(None)
        self._closed.wait(patience_s)

    def _hear(self) -> None:
        for message in received(self._input):
            self._inbox.put(message)
        self.gone.set()
        self._inbox.wake()

    def _speak(self) -> None:
        send(self._outgoing, self._output)  # it ends early when the parent is gone
        self._closed.set()


def serve(run: Callable[[Any, Parent], None]) -> int:
    """Run the work of a child with its order; return the process's exit status.

    A failure is reported as ``failed``, with its reason.
    """
    parent = Parent()
    if (order := parent.order()) is None:
        return 0
    try:
        run(order, parent)
    # The error's words are on their way before the error is let go of: with it go windows and sound
    # servers, and their libraries may end the process.
    except LabcraneError as error:
        parent.tell({"failed": str(error)})
        parent.close()
        return 1
    except Exception as error:
        parent.tell({"failed": told(error)})
        parent.close()
        raise  # a plugin's mistake: its author needs the traceback
    finally:
        parent.close()
    return 0
