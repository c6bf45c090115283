"""Guard of the pages' door: who speaks to whom, how much and how often, before anything is read.

It stands before :class:`labcrane.web.server.access.Gate`, which asks for cookies. Nothing of a body
is kept beyond its limit, and nobody waits longer than :data:`PATIENCE_S` for a slow one.
"""

import asyncio
from collections import defaultdict
from collections.abc import Callable, Mapping
from typing import Any
from weakref import WeakSet

from starlette.responses import PlainTextResponse
from uvicorn.protocols.http.h11_impl import H11Protocol

from labcrane.limits import LIMITS
from labcrane.web.server.denials import Bucket

PATIENCE_S = 10.0
"""How long a request, and its body, may take to come."""

MOST_BODY = LIMITS["request body"].most
MOST_REQUESTS_S = LIMITS["requests of one address"].most
MOST_LOADS_S = LIMITS["page loads of one address"].most
LOADS_AT_ONCE = 30
"""A page is built for each load, which takes 30 ms: fifty per second would leave no
time for the actions of others."""

MOST_REST_S = 0.1
"""Rest after a page at most: one that waited for something has not taken this process's time."""

PAGES = frozenset({"/supervisor", "/participant", "/viewer", "/study", "/start"})
MOST_SOCKETS = LIMITS["sockets"].most
MOST_ADDRESSES = 1024

LOOPBACK = ("127.0.0.1", "localhost", "[::1]")

HEADERS = (
    # NiceGUI writes scripts and styles into the page, and its templates are compiled there.
    (
        b"content-security-policy",
        b"default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval'; "
        b"style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; media-src data:; "
        b"font-src 'self' data:; connect-src 'self'; worker-src 'self' blob:; object-src 'none'; "
        b"base-uri 'self'; form-action 'self'; frame-ancestors 'none'",
    ),
    (b"x-frame-options", b"DENY"),
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"no-referrer"),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"cross-origin-resource-policy", b"same-origin"),
)
"""Sent with every answer."""


class Guard:
    """Refuses foreign hosts and origins, floods and bodies without end; an ASGI application.

    Parameters
    ----------
    inner
        What it guards.
    host, port
        Where the pages are served.
    denied
        Told of what was refused.
    most_body
        Bytes of the largest request.
    """

    def __init__(
        self,
        inner: Callable[..., Any],
        host: str,
        port: int,
        denied: Callable[[str], None],
        *,
        secure: bool = False,
        most_body: int = MOST_BODY,
    ) -> None:
        self._inner = inner
        self._most_body = most_body
        self._denied = denied
        names = {host, *(LOOPBACK if host in LOOPBACK else ())}
        self._hosts = {f"{name}:{port}" for name in names}
        usual, self._scheme = (443, "https") if secure else (80, "http")
        if port == usual:
            self._hosts |= names
        self._buckets: dict[tuple[str, bool], Bucket] = {}
        self._turn = asyncio.Lock()

    async def __call__(self, scope: dict[str, Any], receive: Any, send: Any) -> None:
        """Let a request in, or refuse it."""
        if scope["type"] not in {"http", "websocket"}:
            await self._inner(scope, receive, send)
            return
        headers = dict(scope["headers"])
        if (refused := self._refused(scope, headers)) is not None:
            await self._refuse(scope, receive, send, *refused)
            return
        if scope["type"] == "http":
            body = await self._body(headers, receive)
            if isinstance(body, int):
                why = {413: f"more than {self._most_body} bytes", 408: "too slow"}[body]
                await self._refuse(scope, receive, send, body, why)
                return
            receive = _given(body, receive)
            if scope["path"] in PAGES:
                await self._in_turn(scope, receive, _with_headers(send))
                return
        await self._inner(scope, receive, _with_headers(send))

    async def _in_turn(self, scope: dict[str, Any], receive: Any, send: Any) -> None:
        """Put a page together when it is its turn, and rest as long as that took.

        So page loads, from however many addresses, take half of this process's time at most,
        and an action waits for one page, not for all that were requested at once.
        """
        await self._turn.acquire()
        clock = asyncio.get_running_loop()
        began: float | None = clock.time()

        def rest() -> None:
            nonlocal began
            if began is not None:
                took, began = clock.time() - began, None
                clock.call_later(min(took, MOST_REST_S), self._turn.release)

        async def sent(message: dict[str, Any]) -> None:
            rest()  # it is put together; who reads slowly keeps nobody waiting
            await send(message)

        try:
            await self._inner(scope, receive, sent)
        finally:
            rest()

    def _refused(
        self, scope: Mapping[str, Any], headers: Mapping[bytes, bytes]
    ) -> tuple[int, str] | None:
        if not self._bucket(_address(scope)).take():
            return 429, f"more than {MOST_REQUESTS_S} requests a second"
        if scope["path"] in PAGES and not self._bucket(_address(scope), loads=True).take():
            return 429, f"more than {MOST_LOADS_S} pages a second"
        host = headers.get(b"host", b"").decode(errors="replace")
        if host not in self._hosts:
            return 421, f"of host {host[:60]!r}, which is not served here"
        origin = headers.get(b"origin")  # programs send none; browsers do with all that changes
        if origin is not None and origin.decode(errors="replace") != f"{self._scheme}://{host}":
            return 403, f"from a page of {origin[:60].decode(errors='replace')!r}"
        return None

    def _bucket(self, address: str, *, loads: bool = False) -> Bucket:
        key = address, loads
        if key not in self._buckets:
            if len(self._buckets) >= MOST_ADDRESSES:
                self._buckets.clear()
            self._buckets[key] = (
                Bucket(MOST_LOADS_S, LOADS_AT_ONCE)
                if loads
                else Bucket(MOST_REQUESTS_S, 2 * MOST_REQUESTS_S)
            )
        return self._buckets[key]

    async def _body(self, headers: Mapping[bytes, bytes], receive: Any) -> bytes | int:
        """Return a request's body, or the status with which it is refused."""
        length = headers.get(b"content-length", b"0")
        if not length.isdigit() or len(length) > 15 or int(length) > self._most_body:  # noqa: PLR2004
            return 413
        body: bytes
        body, ends = b"", asyncio.get_running_loop().time() + PATIENCE_S
        while True:
            left = ends - asyncio.get_running_loop().time()
            try:
                message = await asyncio.wait_for(receive(), left)
            except TimeoutError:
                return 408
            body += message.get("body", b"")
            if len(body) > self._most_body:
                return 413
            if not message.get("more_body", False):
                return body

    async def _refuse(
        self, scope: Mapping[str, Any], receive: Any, send: Any, status: int, why: str
    ) -> None:
        path = str(scope["path"])[:80]
        self._denied(f"{_address(scope)} asked for {path}: {why}")
        if scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008})
            return
        answer = PlainTextResponse(f"labcrane: {why}", status, {"connection": "close"})
        answer.raw_headers.extend(HEADERS)
        await answer(dict(scope), receive, send)


def _address(scope: Mapping[str, Any]) -> str:
    return str((scope.get("client") or ("unknown",))[0])


def _given(body: bytes, receive: Any) -> Any:
    """Return what gives a body that has been read, and then what else comes."""
    waiting = [{"type": "http.request", "body": body, "more_body": False}]

    async def give() -> Any:
        return waiting.pop() if waiting else await receive()

    return give


def _with_headers(send: Any) -> Any:
    async def sent(message: dict[str, Any]) -> None:
        if message["type"] in {"http.response.start", "websocket.http.response.start"}:
            own = {name for name, _ in HEADERS}
            kept = [each for each in message.get("headers", ()) if each[0].lower() not in own]
            message = {**message, "headers": [*kept, *HEADERS]}
        await send(message)

    return sent


_open: defaultdict[str, "WeakSet[BoundedProtocol]"] = defaultdict(WeakSet)


class BoundedProtocol(H11Protocol):
    """HTTP of few connections for each address, and none that stays silent."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Take a connection, or close it when its address has as many as it may have."""
        peer = transport.get_extra_info("peername")
        own = _open[str(peer[0]) if peer else "unknown"]
        there = sum(not each.transport.is_closing() for each in own)
        super().connection_made(transport)
        if there >= MOST_SOCKETS:
            transport.abort()
            return
        own.add(self)
        self.loop.call_later(PATIENCE_S, self._end_silent)

    def _end_silent(self) -> None:
        request: object = self.cycle  # None before the first
        if request is None and self.transport.get_protocol() is self:
            self.transport.close()
