"""The launcher's side of the pages: starts their process, starts it again, passes on."""

import math
import socket
import threading
import time
from collections.abc import Callable
from typing import Any

from labcrane.core.records import Event
from labcrane.errors import DeviceError
from labcrane.processes.handle import Patience, ProcessHandle
from labcrane.session.commands import Command
from labcrane.web.server.access import NAMES
from labcrane.web.service import Closed, Opened, PageConfig, Report, Served, Streams, Used
from labcrane.web.state import SessionLeft

MODULE = "labcrane.web.service"

LOOK_S = 0.2
MOST_RESTARTS = 5
END_S = 3.0
"""How long the process may take to end by itself."""

LAST_LOOK_S = 0.5
"""How long a page has to show the end before its process ends, where nobody looks at it."""

GONE_S = 10.0
"""How long no browser may have the experimenter's page before it counts as closed: a reload
leaves it for a moment, and on a busy computer for some seconds."""


class PageHandle:
    """Keeps the page process running for as long as the run lasts, and says the pages' links once.

    A page that hangs never makes the launcher wait. Events are kept, and the last status of the
    streams: a page that is restarted receives all of them, also after the recorder has ended.

    Parameters
    ----------
    give
        Takes what the pages ask for.
    say
        Tells the people at the terminal.
    streams
        Returns the recorder's status of the external streams.
    """

    def __init__(
        self,
        order: PageConfig,
        give: Callable[[Command], None],
        say: Callable[[str], None],
        streams: Callable[[], dict[str, Any]],
    ) -> None:
        self._order = order
        self._give = give
        self._say = say
        self._streams = streams
        self._told: list[Event | Report] = []
        self._status: dict[str, Any] = {}
        self._browsers = 0
        self._left_at = -math.inf
        self._closed = threading.Event()
        self._given_up = False
        self._served = False
        self._over = threading.Event()
        self._lock = threading.Lock()
        patience = Patience(stop_s=END_S, restarts=MOST_RESTARTS)
        self._process = ProcessHandle(MODULE, "pages", patience, self._take)
        self._process.start(order)
        self._watcher = threading.Thread(target=self._watch, name="pages")
        self._watcher.start()

    @property
    def restarts(self) -> int:
        """How often the pages were started again."""
        return self._process.restarts

    def links(self) -> dict[str, str]:
        """Return the one-time link to each page."""
        order = self._order
        scheme = "http" if order.certificate is None else "https"
        return {
            page: f"{scheme}://{order.host}:{order.port}/{page}?token={token}"
            for page, token in order.keys.tokens.items()
        }

    def tell(self, event: Event) -> None:
        """Tell the pages of an event, without waiting for them."""
        with self._lock:
            self._told.append(event)
            self._process.tell(event)

    def close(self, ended: SessionLeft) -> None:
        """Show the end until the experimenter has closed the page, and end the process.

        It does not wait if no browser has it. An interrupt at the terminal closes it too.
        """
        with self._lock:
            self._told.append(Report(ended))
            self._process.tell(Report(ended))
        try:
            self._over.wait(LAST_LOOK_S)
            if self._open():
                self._say("the experimenter's page shows what was saved until you close it; "
                          "press Ctrl-C to close it from here")  # fmt: skip
            while self._open():
                self._over.wait(LOOK_S)
        except KeyboardInterrupt:
            pass
        finally:
            self._over.set()
            self._watcher.join()
            self._process.stop()

    def _open(self) -> bool:
        """Whether a browser has the experimenter's page, or had it a moment ago."""
        if self._closed.is_set() or self._given_up:
            return False
        return self._browsers > 0 or time.monotonic() - self._left_at < GONE_S

    def _watch(self) -> None:
        while not self._over.wait(LOOK_S):
            if self._process.exit_code is not None and not self._restart():
                self._given_up = True
                self._say("the page keeps crashing; the session continues without it")
                return
            if not self._process.waiting:  # the newest status, when all before it has gone
                self._status = self._streams() or self._status
                self._process.tell(Streams(self._status))

    def _restart(self) -> bool:
        with self._lock:
            if not self._process.restart(self._order):
                return False
            for event in self._told:
                self._process.tell(event)
        if self._browsers:  # only browsers that still show it reconnect
            self._browsers, self._left_at = 0, time.monotonic()
        self._say("the page crashed and was restarted")
        return True

    def _take(self, message: Command | Served | Used | Opened | Closed) -> None:
        if isinstance(message, Served):
            if not self._served:
                for page, link in self.links().items():
                    self._say(f"{NAMES[page]}'s page: {link}")
            self._served = True
        elif isinstance(message, Used):
            self._order.keys.tokens.pop(message.page, None)
        elif isinstance(message, Opened):
            if self._browsers and not message.browsers:
                self._left_at = time.monotonic()
            self._browsers = message.browsers
        elif isinstance(message, Closed):
            self._closed.set()
        else:
            self._give(message)


def free_port(host: str, wanted: int) -> int:
    """Return ``wanted``, or a free port when it is 0.

    Raises
    ------
    DeviceError
        Nothing can be served there.
    """
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, wanted))
        except OSError as error:
            raise DeviceError(
                f"the page cannot be served on {host}:{wanted}: {error.strerror}; change page in "
                "the protocol, or run with --no-page"
            ) from error
        return int(probe.getsockname()[1])
