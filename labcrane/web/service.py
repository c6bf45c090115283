"""The page process: a web server, and one pipe to the launcher."""

import mimetypes
import os
import signal
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from labcrane.approval.lock import read_lock
from labcrane.core.records import Event
from labcrane.design.plan import plan_session
from labcrane.protocol.study import load
from labcrane.registry.registry import discover
from labcrane.session.commands import Command, Order
from labcrane.web.access import SCOPE, SUPERVISOR, Gate, Keys
from labcrane.web.live import Live
from labcrane.web.page import PageContext
from labcrane.web.pictures import Pictures
from labcrane.web.state import SessionView

FORBIDDEN, NOT_FOUND = 403, 404
NICENESS = 15
"""The loop's process comes first when the computer is busy, whatever browsers ask for."""


@dataclass(frozen=True)
class PageConfig:
    """What the page process is told.

    Attributes
    ----------
    folder_name
        The participant's pseudonym with its stamps.
    source
        Which session's LSL streams are shown: ``"aiming/P001/ses-01"``.
    cameras
        Names of the cameras whose pictures are shown, by the view that sends them.
    """

    protocol: Path
    participant: str
    folder_name: str
    session: int
    source: str
    host: str
    port: int
    cameras: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    keys: Keys = field(default_factory=Keys)


@dataclass(frozen=True, slots=True)
class Used:
    """Said to the launcher: a page's token was used, and is used up."""

    page: str


@dataclass(frozen=True, slots=True)
class Streams:
    """Said by the launcher: what the recorder says of the streams of others."""

    status: dict[str, Any]


@dataclass(frozen=True, slots=True)
class Report:
    """Said by the launcher at the end: the lines of the sync report."""

    lines: list[str]


def serve(order: PageConfig, pipe: Connection) -> None:
    """Serve both pages until the launcher closes the pipe; the process's main function."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the launcher says when it is over
    if hasattr(os, "nice"):
        os.nice(NICENESS)
    import uvicorn  # noqa: PLC0415
    from fastapi import FastAPI  # noqa: PLC0415
    from nicegui import ui  # noqa: PLC0415 - loads for a second

    study = load(order.protocol, discover(study=order.protocol))
    plan = plan_session(study, order.participant, order.session)
    lock = threading.Lock()

    def send(message: Command | Used) -> None:
        with lock:
            try:
                pipe.send(message)
            except OSError:
                return  # the launcher is gone, and this process is about to end

    live, pictures = Live(order.source), Pictures(order.source, order.cameras)
    desk = PageContext(study, plan, order.folder_name, SessionView(), live, pictures, send)
    app = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)
    _routes(app, desk)
    ui.run_with(app, title="labcrane", show_welcome_message=False)
    gate = Gate(
        app,
        order.keys,
        lambda page: send(Used(page)),
        lambda why: send(Command(Order.DENIED, why, "page")),
    )
    config = uvicorn.Config(
        gate, host=order.host, port=order.port, log_level="error", server_header=False
    )
    server = uvicorn.Server(config)
    end = partial(setattr, server, "should_exit", True)  # noqa: FBT003 - the attribute's value
    threading.Thread(target=_listen, args=(pipe, desk.board, end), daemon=True).start()
    server.run()
    pictures.close()


def _listen(pipe: Connection, board: SessionView, end: Callable[[], None]) -> None:
    while True:
        try:
            message = pipe.recv()
        except (EOFError, OSError):
            end()
            return
        if isinstance(message, Event):
            board.take(message)
        elif isinstance(message, Streams):
            board.streams = message.status
        elif isinstance(message, Report):
            board.sync_report = message.lines


def _routes(app: Any, desk: PageContext) -> None:
    from fastapi import Request, Response  # noqa: PLC0415
    from nicegui import ui  # noqa: PLC0415

    from labcrane.web.examiner_page import supervisor_page  # noqa: PLC0415
    from labcrane.web.participant_page import participant_page  # noqa: PLC0415

    @ui.page("/supervisor")
    def supervisor() -> None:
        supervisor_page(desk)

    @ui.page("/participant")
    def participant() -> None:
        participant_page(desk)

    @app.get("/consent")  # type: ignore[untyped-decorator]  # app may be any ASGI app
    def consent() -> Response:
        """Give the approved consent text, as it is asked for; no other file can be had."""
        if not desk.board.consent:
            return Response("no consent is asked for", NOT_FOUND)
        text = read_lock(desk.study.path).consent
        kind, _ = mimetypes.guess_type(text.name)
        return Response(text.read_bytes(), media_type=kind or "application/octet-stream")

    @app.post("/orders/{word}")  # type: ignore[untyped-decorator]  # app may be any ASGI app
    async def order(word: str, request: Request) -> Response:
        """Take an order from a foot switch or a script that has a page's cookie."""
        pages = request.scope[SCOPE]
        page = SUPERVISOR if SUPERVISOR in pages else next(iter(pages))
        if word not in set(Order):
            return Response(f"{word!r} is not an order", FORBIDDEN)
        text = (await request.body()).decode(errors="replace")
        if not desk.give(page, Order(word), text):
            return Response(f"the {page} page has no right to order {word}", FORBIDDEN)
        return Response(status_code=202)
