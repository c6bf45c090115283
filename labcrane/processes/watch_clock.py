"""Clock of a process that waits for others to report."""

import threading
import time

MOST_S = 1.0
"""What the time between two readings counts for at most, in seconds."""


class WatchClock:
    """Counts seconds, but not those in which the process that reads it stood still.

    A process is stopped by Ctrl-Z, by a computer that sleeps or by one that is overloaded. When it
    goes on, what others reported in the meantime still waits to be read: by an ordinary clock they
    would look as if they hung. Threads may share it.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._read = time.monotonic()
        self._counted = 0.0

    def __call__(self) -> float:
        """Return the seconds counted so far."""
        with self._lock:
            now = time.monotonic()
            self._counted += min(now - self._read, MOST_S)
            self._read = now
            return self._counted
