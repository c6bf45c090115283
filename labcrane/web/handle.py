"""The launcher's side of the pages: starts their process, starts it again, passes on."""

import multiprocessing
import queue
import socket
import threading
from collections.abc import Callable
from multiprocessing.connection import wait
from typing import Any

from labcrane.core.records import Event
from labcrane.errors import DeviceError
from labcrane.processes.pipe import PipeEnd
from labcrane.session.commands import Command
from labcrane.web.service import PageConfig, Report, Streams, Used, serve

LOOK_S = 0.2
MOST_RESTARTS = 5
END_S = 3.0
"""How long the process may take to end by itself."""

LAST_LOOK_S = 0.5
"""How long a page has to show the end before its process ends."""


class PageHandle:
    """Keeps the page process running for as long as the run lasts.

    Its own threads talk to the page, so a page that hangs never makes the launcher wait. Events are
    kept: a page that is started again is told all of them.

    Parameters
    ----------
    give
        Takes what the pages ask for.
    say
        Tells the people at the terminal.
    streams
        Says what the recorder says of the streams of others.
    """

    def __init__(
        self,
        order: PageConfig,
        give: Callable[[Command], None],
        say: Callable[[str], None],
        streams: Callable[[], dict[str, Any]],
    ) -> None:
        self.restarts = 0
        self._order = order
        self._give = give
        self._say = say
        self._streams = streams
        self._told: list[Event] = []
        self._over = threading.Event()
        self._news: queue.SimpleQueue[Event | Streams | Report | None] = queue.SimpleQueue()
        self._lock = threading.Lock()
        self._watcher = threading.Thread(target=self._watch, name="pages")
        self._watcher.start()

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
            self._news.put(event)

    def close(self, report: list[str]) -> None:
        """Show the end, and end the process."""
        self._news.put(Report(report))
        self._over.wait(LAST_LOOK_S)
        self._over.set()
        self._news.put(None)
        self._watcher.join()

    def _watch(self) -> None:
        while not self._over.is_set():
            context = multiprocessing.get_context("spawn")
            ours, theirs = context.Pipe()
            process = context.Process(target=serve, args=(self._order, theirs), name="pages")
            process.start()
            theirs.close()
            sender = threading.Thread(target=self._send, args=(ours,), daemon=True)
            with self._lock:
                self._news.put(None)  # for the sender of a process that died
                self._news = queue.SimpleQueue()
                for event in self._told:
                    self._news.put(event)
            sender.start()
            self._receive(ours, process.sentinel)
            ours.close()  # which the process takes for the end
            process.join(END_S)  # a killed one leaves semaphores, and Python complains of them
            process.kill()
            process.join()
            if self._over.is_set():
                return
            if self.restarts == MOST_RESTARTS:
                self._say("the page keeps dying; the run goes on without it")
                return
            self.restarts += 1
            self._say("the page died and is started again")

    def _receive(self, pipe: PipeEnd, sentinel: int) -> None:
        while not self._over.is_set():
            ready = wait([pipe, sentinel], LOOK_S)
            self._news.put(Streams(self._streams()))
            try:
                while pipe.poll():
                    self._heed(pipe.recv())
            except (EOFError, OSError):
                return
            if sentinel in ready:
                return

    def _heed(self, message: Command | Used) -> None:
        if isinstance(message, Used):
            self._order.keys.tokens.pop(message.page, None)
        else:
            self._give(message)

    def _send(self, pipe: PipeEnd) -> None:
        news = self._news
        while (message := news.get()) is not None:
            try:
                pipe.send(message)
            except OSError:
                return


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
