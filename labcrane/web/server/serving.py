"""Serving of a page for this computer only, behind the same door, until it is interrupted."""

import secrets
import socket
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from labcrane.limits import LIMITS
from labcrane.web.server.access import AccessKeys, Gate

if TYPE_CHECKING:
    import uvicorn

HOST = "127.0.0.1"
MOST_HEAD = 16_384
"""Bytes of a request's line and headers."""

AWAY_S = 30.0
"""How long a browser may be without connection, as a tablet or a laptop that sleeps, and find its
page unchanged. After that the page is reloaded; unsaved text is in the browser."""

MOST_MISSED = 1000


def serve_here(
    app: Any,
    page: str,
    port: int,
    say: Callable[[str], None],
    most_body: int = LIMITS["request body"].most,
) -> None:
    """Serve an application whose first page is ``page``; ``say`` is then told its one-time link."""
    from labcrane.web.server.guard import Guard  # noqa: PLC0415 - loads for a second

    keys = AccessKeys({page: secrets.token_urlsafe(24)}, {page: secrets.token_urlsafe(24)})
    link = f"http://{HOST}:{port}/{page}?token={keys.tokens[page]}"
    guard = Guard(Gate(app, keys, lambda _: None, say, port), HOST, port, say, most_body=most_body)
    announcing(guard, HOST, port, lambda: say(f"{page}: {link}")).run()


def announcing(
    app: Any, host: str, port: int, served: Callable[[], None], **secure: Any
) -> "uvicorn.Server":
    """Return a server that calls ``served`` as soon as pages can be opened.

    ``secure`` is what uvicorn needs for TLS; nothing without.
    """
    import uvicorn  # noqa: PLC0415

    from labcrane.web.server.guard import BoundedProtocol  # noqa: PLC0415

    class Announcing(uvicorn.Server):
        async def startup(self, sockets: list[socket.socket] | None = None) -> None:
            await super().startup(sockets)
            if self.started:
                served()

    config = uvicorn.Config(
        app,
        host=host,
        port=port,
        log_level="error",
        server_header=False,
        http=BoundedProtocol,
        h11_max_incomplete_event_size=MOST_HEAD,
        ws_max_size=LIMITS["message of a page"].most,
        ws_per_message_deflate=False,  # a few bytes of it can stand for megabytes
        **secure,
    )
    return Announcing(config)


def build_pages(app: Any, missed: int = MOST_MISSED) -> None:
    """Let NiceGUI build the pages of an application.

    ``missed`` is how many changes of a page are kept for a browser that is away.
    """
    from nicegui import app as own  # noqa: PLC0415 - loads for a second
    from nicegui import ui  # noqa: PLC0415

    # The progress bar of requests has no name, and screen readers would announce it.
    own.config.quasar_config["loadingBar"]["skipHijack"] = True
    ui.run_with(app, title="labcrane", show_welcome_message=False, message_history_length=missed)
