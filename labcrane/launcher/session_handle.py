"""Handle of the session's process: sends it messages and receives its reports."""

import math
import pickle
from collections.abc import Callable

from labcrane.core.records import Event
from labcrane.launcher.session_process import Offered, SessionEnded
from labcrane.processes.handle import Patience, ProcessHandle
from labcrane.session.commands import MessageError, Sent, encode
from labcrane.session.visit import Visit

MODULE = "labcrane.launcher.session_process"

MOST_WAITING = 1000
"""Most messages that may wait for a session that takes none; it hangs, and is soon killed."""


class SessionHandle:
    """Starts the session of a visit. It is never restarted; ``labcrane resume`` continues it.

    A session that hangs takes no messages, and may hang in the middle of one. Neither blocks the
    launcher, which has to notice it.

    Parameters
    ----------
    say
        Receives a message about what could not be sent.
    """

    def __init__(self, visit: Visit, say: Callable[[str], None]) -> None:
        self._say = say
        self._process = ProcessHandle(MODULE, "session", Patience(stop_s=math.inf))
        self._process.start(pickle.dumps(visit))

    def send(self, message: Sent) -> None:
        """Send a message, without waiting; say so when it cannot be sent."""
        try:
            line = encode(message)
        except MessageError as error:
            self._say(str(error))
            return
        if self._process.waiting >= MOST_WAITING:
            self._say(f"the session takes no messages; {MOST_WAITING} wait, and one was dropped")
            return
        self._process.tell(line)

    def wait(self, seconds: float) -> list[Event | Offered | SessionEnded]:
        """Return its messages, and wait up to so long for them."""
        self._process.wait(seconds)
        return self._process.messages()

    @property
    def ended(self) -> bool:
        """Whether it has ended or died, and :meth:`wait` returns nothing new but what is left."""
        return self._process.ended

    def kill(self) -> None:
        """End it at once: its journal is intact, and its messages can still be read."""
        self._process.kill()

    def close(self) -> int:
        """Wait for its end; its exit code."""
        code = self._process.stop()
        if code is None:
            raise AssertionError("the session's end is waited for without a limit")
        return code
