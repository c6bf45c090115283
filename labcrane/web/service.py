"""The page process: a web server, and messages from and to the launcher."""

import importlib
import mimetypes
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from labcrane.approval.lock import read_lock
from labcrane.core.records import Event
from labcrane.design.plan import plan_session
from labcrane.processes.parent import Parent
from labcrane.protocol.study import load
from labcrane.registry.registry import discover
from labcrane.session.commands import Command, Order
from labcrane.web.control_room.earlier import Earlier, read_behind
from labcrane.web.control_room.shown import ShownShapes
from labcrane.web.live import Live
from labcrane.web.page import PageContext
from labcrane.web.pictures import Pictures
from labcrane.web.server.access import SCOPE, SUPERVISOR, AccessKeys, Gate
from labcrane.web.server.denials import Denials
from labcrane.web.server.serving import AWAY_S, announcing, build_pages
from labcrane.web.state import SessionLeft, SessionView

FORBIDDEN, NOT_FOUND = 403, 404
NICENESS = 5
"""The loop's process comes first when the computer is busy, whatever browsers ask for; at 15
the pages could not be reached for more than a minute."""

MISSED = 10_000
"""How many changes of a page are kept for a browser that is away: more than come in ``AWAY_S``. One
that has missed more is reloaded too."""


@dataclass(frozen=True)
class PageConfig:
    """Configuration of the page process.

    Attributes
    ----------
    folder_name
        The participant's pseudonym with its stamps.
    source
        Which session's LSL streams are shown: ``"aiming/P001/ses-01"``.
    cameras
        Names of the cameras whose pictures are shown, by the view that sends them.
    data
        The participant's folder, next to those of the others; None for no comparison.
    certificate, key
        Of the lab, in PEM; without them the pages are served without TLS.
    """

    protocol: Path
    participant: str
    folder_name: str
    session: int
    source: str
    host: str
    port: int
    cameras: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    certificate: Path | None = None
    key: Path | None = None
    keys: AccessKeys = field(default_factory=AccessKeys)
    recorded: bool = False
    data: Path | None = None


@dataclass(frozen=True, slots=True)
class Served:
    """Said to the launcher: the pages can be opened now."""


@dataclass(frozen=True, slots=True)
class Used:
    """Said to the launcher: a page's token was used, and is used up."""

    page: str


@dataclass(frozen=True, slots=True)
class Streams:
    """From the launcher: the recorder's status of the external streams."""

    status: dict[str, Any]


@dataclass(frozen=True, slots=True)
class Report:
    """Said by the launcher at the end: what the session left behind."""

    ended: SessionLeft


@dataclass(frozen=True, slots=True)
class Opened:
    """To the launcher: the experimenter's page is open in some browser, or in none."""

    browsers: int


@dataclass(frozen=True, slots=True)
class Closed:
    """To the launcher: the experimenter has seen the end, and closed the page."""


def main() -> int:
    """Serve the pages of one run; return the process's exit status."""
    parent = Parent()
    if (order := parent.order()) is None:
        return 0
    serve(order, parent)
    parent.close()
    return 0


def serve(order: PageConfig, parent: Parent) -> None:
    """Serve both pages until the launcher says that it is over, or has died."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the launcher says when it is over
    if hasattr(os, "nice"):
        os.nice(NICENESS)
    from fastapi import FastAPI  # noqa: PLC0415 - loads for a second

    from labcrane.web.server.guard import Guard  # noqa: PLC0415

    study = load(order.protocol, discover(study=order.protocol), recorded=order.recorded)
    plan = plan_session(study, order.participant, order.session)
    denials = Denials(lambda why: parent.tell(Command(Order.DENIED, why, "page")))
    live, pictures = Live(order.source), Pictures(order.source, order.cameras)
    view, shown = SessionView(), ShownShapes(study.cues)
    shown.follow(order.source)
    measures = [
        name for task in study.tasks.values() for one in task.results for name in one.columns
    ]
    context = PageContext(
        study,
        plan,
        order.folder_name,
        view,
        live,
        pictures,
        parent.tell,
        denials,
        shown,
        _earlier(order, study.protocol.study, measures),
        close=lambda: parent.tell(Closed()),
    )
    app = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)
    _routes(app, context, lambda browsers: parent.tell(Opened(browsers)))
    build_pages(app, MISSED)
    secure = order.certificate is not None
    gate = Gate(
        app, order.keys, lambda page: parent.tell(Used(page)), denials, order.port, secure=secure
    )
    server = announcing(
        Guard(gate, order.host, order.port, denials, secure=secure),
        order.host,
        order.port,
        lambda: parent.tell(Served()),
        ssl_certfile=order.certificate,
        ssl_keyfile=order.key,
    )
    threading.Thread(target=_count, args=(denials,), daemon=True).start()
    end = partial(setattr, server, "should_exit", True)  # noqa: FBT003 - the attribute's value
    threading.Thread(target=_listen, args=(parent, view, end), daemon=True).start()
    server.run()
    pictures.close()


def _earlier(order: PageConfig, study: str, measures: list[str]) -> Earlier:
    """Return what was measured before, as far as there are files to read it from."""
    if order.data is None:
        return Earlier()
    return read_behind(order.data, study, order.session, measures)


def _count(denials: Denials) -> None:
    """Tell once a second what else was refused."""
    while True:
        time.sleep(1.0)
        denials.flush()


def _listen(parent: Parent, view: SessionView, end: Callable[[], None]) -> None:
    for message in parent.incoming():
        if isinstance(message, Event):
            view.take(message)
        elif isinstance(message, Streams):
            view.hear_of_streams(message.status)
        elif isinstance(message, Report):
            view.ended = message.ended
    end()


def _routes(app: Any, context: PageContext, opened: Callable[[int], None]) -> None:
    from fastapi import Request, Response  # noqa: PLC0415
    from nicegui import Client, ui  # noqa: PLC0415

    from labcrane.web.examiner_page import supervisor_page  # noqa: PLC0415
    from labcrane.web.participant_page import participant_page  # noqa: PLC0415

    browsers: set[str] = set()

    def came(client: Client) -> None:
        browsers.add(client.id)
        opened(len(browsers))

    def went(client: Client) -> None:
        browsers.discard(client.id)
        opened(len(browsers))

    @ui.page("/supervisor", reconnect_timeout=AWAY_S)
    def supervisor(client: Client) -> None:
        client.on_connect(came)
        client.on_disconnect(went)
        supervisor_page(context)

    @ui.page("/participant", reconnect_timeout=AWAY_S)
    def participant() -> None:
        participant_page(context)

    _files(app, context)

    @app.post("/orders/{word}")  # type: ignore[untyped-decorator]  # app may be any ASGI app
    async def order(word: str, request: Request) -> Response:
        """Take an order from a foot switch or a script that has a page's cookie."""
        pages = request.scope[SCOPE]
        page = SUPERVISOR if SUPERVISOR in pages else next(iter(pages))
        if word not in set(Order):
            return Response(f"{word!r} is not an order", FORBIDDEN)
        text = (await request.body()).decode(errors="replace")
        if why := context.give(
            page, Order(word), text, request.client.host if request.client else ""
        ):
            return Response(why, FORBIDDEN)
        return Response(status_code=202)


def _files(app: Any, context: PageContext) -> None:
    """Serve the one file of the study that pages show, and no other one."""
    from fastapi import Response  # noqa: PLC0415

    @app.get("/consent")  # type: ignore[untyped-decorator]  # app may be any ASGI app
    def consent() -> Response:
        """Return the approved consent text on request, and no other file."""
        if not context.session.consent:
            return Response("no consent is asked for", NOT_FOUND)
        text = read_lock(context.study.path).consent
        kind, _ = mimetypes.guess_type(text.name)
        return Response(text.read_bytes(), media_type=kind or "application/octet-stream")


if __name__ == "__main__":
    # What it sends is unpickled by the name of this module, which is not __main__.
    status = importlib.import_module("labcrane.web.service").main()
    # A thread that reads recordings may have h5py's lock when Python is torn down: what is given
    # back then would wait for it for ever, and the process outlive its session.
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)
