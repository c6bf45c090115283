"""Access to pages: a token opens a page once, a cookie keeps it open for the run."""

import secrets
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import parse_qs

from starlette.requests import HTTPConnection
from starlette.responses import PlainTextResponse, RedirectResponse

from labcrane.session.commands import Order

SUPERVISOR, PARTICIPANT = "supervisor", "participant"
NAMES = {SUPERVISOR: "experimenter", PARTICIPANT: "participant"}

RIGHTS: Mapping[str, frozenset[Order]] = {
    SUPERVISOR: frozenset(Order) - {Order.DENIED},
    PARTICIPANT: frozenset({Order.ANSWER, Order.SUBMIT, Order.CONSENT, Order.REPORT}),
}
"""The actions that each page may send to the session."""

SEE_OTHER, FORBIDDEN = 303, 403

SCOPE = "labcrane.pages"
"""Where a request says which pages its cookies open."""


def _secret() -> str:
    return secrets.token_urlsafe(24)


VIEWER = "viewer"
"""The page of a recording; it orders nothing."""

STUDY = "study"
"""The page of a whole study; it orders nothing either."""

START = "start"
"""The page on which a study is made; its requests are its own."""


@dataclass
class AccessKeys:
    """The secrets of one run; they end with it.

    Attributes
    ----------
    tokens
        By page; a token that was used is gone.
    cookies
        By page: what a browser shows after it has used the token.
    """

    tokens: dict[str, str] = field(default_factory=lambda: {page: _secret() for page in RIGHTS})
    cookies: dict[str, str] = field(default_factory=lambda: {page: _secret() for page in RIGHTS})


class Gate:
    """Stands before the whole web server: nothing passes without a cookie, not even a picture.

    Parameters
    ----------
    inner
        The web server, an ASGI application.
    used, denied
        Told of a page whose token was used, and of who was refused what.
    port
        Where it is served. Browsers give a cookie to every port of a host: without it in the
        cookie's name, what is served at one port would take away the right to see another.
    """

    def __init__(
        self,
        inner: Callable[..., Any],
        keys: AccessKeys,
        used: Callable[[str], None],
        denied: Callable[[str], None],
        port: int,
        *,
        secure: bool = False,
    ) -> None:
        self._secure = secure
        self._port = port
        self._inner = inner
        self._keys = keys
        self._used = used
        self._denied = denied

    async def __call__(self, scope: dict[str, Any], receive: Any, send: Any) -> None:
        """Let a request in, exchange its token, or refuse and log it."""
        if scope["type"] not in {"http", "websocket"}:
            await self._inner(scope, receive, send)
            return
        path = scope["path"].strip("/")
        given = parse_qs(scope.get("query_string", b"").decode(errors="replace")).get("token")
        if given and path in self._keys.cookies:
            await self._exchange(scope, receive, send, path, given[0])
            return
        pages = self._opened(scope)
        if not pages or (path in self._keys.cookies and path not in pages):
            await self._refuse(scope, receive, send, "no right to see it" if pages else "no token")
            return
        await self._inner({**scope, SCOPE: pages}, receive, send)

    def _opened(self, scope: Mapping[str, Any]) -> frozenset[str]:
        shown = HTTPConnection(dict(scope)).cookies
        return frozenset(
            page
            for page in self._keys.cookies
            if secrets.compare_digest(
                shown.get(self._name(page), "").encode(), self._keys.cookies[page].encode()
            )
        )

    async def _exchange(
        self, scope: dict[str, Any], receive: Any, send: Any, page: str, token: str
    ) -> None:
        held = self._keys.tokens.get(page, "")
        if not (held and secrets.compare_digest(token.encode(), held.encode())):
            if page in self._opened(scope):  # a reload of the link in the browser that used it
                await self._redirect(scope, receive, send, page, None)
                return
            await self._refuse(scope, receive, send, "a wrong or used token")
            return
        del self._keys.tokens[page]
        self._used(page)
        await self._redirect(scope, receive, send, page, self._keys.cookies[page])

    async def _redirect(
        self, scope: dict[str, Any], receive: Any, send: Any, page: str, cookie: str | None
    ) -> None:
        # The token leaves the address bar, and is not passed on as a referrer.
        headers = {"referrer-policy": "no-referrer", "cache-control": "no-store"}
        answer = RedirectResponse(f"/{page}", SEE_OTHER, headers)
        if cookie is not None:
            answer.set_cookie(
                self._name(page), cookie, httponly=True, samesite="strict", secure=self._secure
            )
        await answer(scope, receive, send)

    async def _refuse(self, scope: dict[str, Any], receive: Any, send: Any, why: str) -> None:
        host = (scope.get("client") or ("unknown",))[0]
        self._denied(f"{host} asked for {str(scope['path'])[:80]}: {why}")
        if scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008})
            return
        text = f"labcrane: {why}; use the link that labcrane has printed"
        answer = PlainTextResponse(text, FORBIDDEN, {"cache-control": "no-store"})
        await answer(scope, receive, send)

    def _name(self, page: str) -> str:
        return f"labcrane-{page}-{self._port}"
