"""Search for streams on the network: one place for all of labcrane.

liblsl asks the network in waves. Each wave takes one UDP port of its range for as long as answers
may come, up to 5 s, and a search that goes on takes up to twenty of the thirty-two ports there are
by default: two such programs, and no outlet opens any more. A search with a time limit
also waits for the answers to a wave that it sends at its very end, 5 s longer. So a search here is
a look of one wave at a time, its ports are given back, and nobody waits for liblsl.
"""

import atexit
import socket
import threading
import time
import weakref
from typing import TYPE_CHECKING

from labcrane.errors import StreamError

if TYPE_CHECKING:
    import pylsl

LOOK_S = 0.8
"""How long answers are waited for: known peers are asked 0.5 s after everybody, and the next wave
begins 1 s or more after the first."""

PAUSE_S = 0.65
"""Between two looks."""

POLL_S = 0.02

PORTS = 2
"""How many UDP ports of liblsl's range a look takes at most: one wave to all, one to known peers.
Twice as many where IPv6 is allowed."""

_looking = threading.Lock()
"""One look at a time in a process, so that it takes the ports of one."""

_open: "weakref.WeakSet[Search]" = weakref.WeakSet()


class Search:
    """Looks for streams in the background until it is closed.

    Parameters
    ----------
    predicate
        What a stream's description must meet, in XPath 1.0: ``"name='labcrane.frame'"``; all
        streams by default.
    forget_s
        A stream that has not answered for so long is there no more.
    pause_s
        Between two looks.
    """

    def __init__(
        self, predicate: str = "", forget_s: float = 5.0, pause_s: float = PAUSE_S
    ) -> None:
        self._predicate = predicate
        self._forget_s = forget_s
        self._pause_s = pause_s
        self._seen: dict[str, tuple[float, pylsl.StreamInfo]] = {}
        self._lock = threading.Lock()
        self._over = threading.Event()
        self._found = threading.Event()
        # A daemon, so that who forgets to close it can end; at the end it is closed in order.
        self._thread = threading.Thread(target=self._look_on, name="search", daemon=True)
        self._thread.start()
        _open.add(self)

    def results(self) -> "list[pylsl.StreamInfo]":
        """Return the streams that are there, as far as is known; does not wait."""
        since = time.monotonic() - self._forget_s
        with self._lock:
            return [info for when, info in self._seen.values() if when > since]

    def wait(self, seconds: float, minimum: int = 1) -> "list[pylsl.StreamInfo]":
        """Return the streams there are once there are ``minimum``, or when ``seconds`` are over."""
        deadline = time.monotonic() + seconds
        while len(found := self.results()) < minimum:
            self._found.clear()
            if (left := deadline - time.monotonic()) <= 0.0 or self._over.is_set():
                break
            self._found.wait(min(left, POLL_S))
        return found

    def close(self, patience_s: float = 0.0) -> None:
        """End the search; its ports are free when the look under way is over.

        Waits for that up to ``patience_s``: liblsl may take 5 s to end one.
        """
        self._over.set()
        self._thread.join(patience_s)

    def _look_on(self) -> None:
        import pylsl  # noqa: PLC0415 - liblsl reads its configuration when it is loaded

        while not self._over.is_set():
            if not _looking.acquire(timeout=POLL_S):
                continue
            try:
                self._look(pylsl.ContinuousResolver(pred=self._predicate or "uid"))
            finally:
                _looking.release()
            self._over.wait(self._pause_s)

    def _look(self, resolver: "pylsl.ContinuousResolver") -> None:
        ends = time.monotonic() + LOOK_S
        while time.monotonic() < ends and not self._over.wait(POLL_S):
            self._take(resolver.results())

    def _take(self, found: "list[pylsl.StreamInfo]") -> None:
        now = time.monotonic()
        with self._lock:
            for info in found:
                uid = info.uid()
                self._seen[uid] = now, self._seen.get(uid, (now, info))[1]
            self._seen = {
                uid: one for uid, one in self._seen.items() if one[0] > now - self._forget_s
            }
        if found:
            self._found.set()


def find(predicate: str, wait_s: float, minimum: int = 1) -> "list[pylsl.StreamInfo]":
    """Return the streams that meet a predicate, within the time limit.

    Parameters
    ----------
    predicate
        In XPath 1.0; empty for all streams.
    wait_s
        The longest to wait.
    minimum
        Ends as soon as so many are found.
    """
    search = Search(predicate, pause_s=0.05)
    try:
        return search.wait(wait_s, minimum)
    finally:
        search.close()


def equal(**properties: str) -> str:
    """Return the predicate of streams with these properties: ``equal(name="labcrane.frame")``.

    Raises
    ------
    StreamError
        A value holds both kinds of quotes, which XPath 1.0 cannot write.
    """
    parts = []
    for name, value in properties.items():
        if "'" in value and '"' in value:
            raise StreamError(
                f"a stream cannot be searched for by its {name} {value!r}: it holds both kinds of "
                "quotes; rename it"
            )
        quote = '"' if "'" in value else "'"
        parts.append(f"{name}={quote}{value}{quote}")
    return " and ".join(parts)


def known_stream(description: str) -> "pylsl.StreamInfo | None":
    """Return a stream on this computer by its description, without a search.

    Parameters
    ----------
    description
        The XML of ``StreamOutlet.get_info()``, or of a stream that another process has found.

    Returns
    -------
    pylsl.StreamInfo or None
        None when it is on another computer: its description does not hold its address.
    """
    import ctypes  # noqa: PLC0415

    import pylsl  # noqa: PLC0415
    from pylsl.lib import lib  # noqa: PLC0415

    lib.lsl_streaminfo_from_xml.restype = ctypes.c_void_p
    for empty in ("<v4address />", "<v4address></v4address>"):
        description = description.replace(empty, "<v4address>127.0.0.1</v4address>")
    info = pylsl.StreamInfo(handle=lib.lsl_streaminfo_from_xml(description.encode()))
    return info if info.hostname() == socket.gethostname() else None


@atexit.register
def _close_all() -> None:
    """End all searches before the interpreter does: liblsl's threads must not outlive it."""
    searches = list(_open)
    for search in searches:
        search.close()
    for search in searches:
        search.close(patience_s=6.0)
