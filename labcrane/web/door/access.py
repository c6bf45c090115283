"""Access to pages: a token opens a page once, a cookie keeps it open for the run."""

import secrets
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs

from labcrane.session.commands import Order

SUPERVISOR, PARTICIPANT = "supervisor", "participant"

RIGHTS: Mapping[str, frozenset[Order]] = {
    SUPERVISOR: frozenset(Order) - {Order.DENIED},
    PARTICIPANT: frozenset({Order.ANSWER, Order.SUBMIT, Order.CONSENT}),
}
"""What each page may ask of the session."""

SCOPE = "labcrane.pages"
"""Where a request says which pages its cookies open."""


def _secret() -> str:
    return secrets.token_urlsafe(24)


@dataclass
class Keys:
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
    """

    def __init__(
        self,
        inner: Callable[..., Any],
        keys: Keys,
        used: Callable[[str], None],
        denied: Callable[[str], None],
        *,
        secure: bool = False,
    ) -> None:
        self._secure = "; Secure" if secure else ""
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
        if given and path in RIGHTS:
            await self._exchange(scope, send, path, given[0])
            return
        pages = self._opened(scope)
        if not pages or (path in RIGHTS and path not in pages):
            await self._refuse(scope, send, "no right to see it" if pages else "no token")
            return
        await self._inner({**scope, SCOPE: pages}, receive, send)

    def _opened(self, scope: Mapping[str, Any]) -> frozenset[str]:
        headers = dict(scope["headers"])
        cookie = SimpleCookie()
        try:
            cookie.load(headers.get(b"cookie", b"").decode(errors="replace"))
        except CookieError:
            return frozenset()
        shown = {page: cookie[_name(page)].value for page in RIGHTS if _name(page) in cookie}
        return frozenset(
            page
            for page, value in shown.items()
            if secrets.compare_digest(value.encode(), self._keys.cookies[page].encode())
        )

    async def _exchange(self, scope: dict[str, Any], send: Any, page: str, token: str) -> None:
        held = self._keys.tokens.get(page, "")
        if not (held and secrets.compare_digest(token.encode(), held.encode())):
            if page in self._opened(scope):  # a reload of the link in the browser that used it
                await _redirect(send, page, None)
                return
            await self._refuse(scope, send, "a wrong or used token")
            return
        del self._keys.tokens[page]
        self._used(page)
        await _redirect(send, page, self._keys.cookies[page] + self._secure)

    async def _refuse(self, scope: Mapping[str, Any], send: Any, why: str) -> None:
        host = (scope.get("client") or ("unknown",))[0]
        self._denied(f"{host} asked for {str(scope['path'])[:80]}: {why}")
        if scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008})
            return
        text = f"labcrane: {why}; use the link that labcrane run has printed".encode()
        head = [(b"content-type", b"text/plain; charset=utf-8"), (b"cache-control", b"no-store")]
        await send({"type": "http.response.start", "status": 403, "headers": head})
        await send({"type": "http.response.body", "body": text})


def _name(page: str) -> str:
    return f"labcrane-{page}"


async def _redirect(send: Any, page: str, cookie: str | None) -> None:
    # The token leaves the address bar, and is not passed on as a referrer.
    headers = [
        (b"location", f"/{page}".encode()),
        (b"referrer-policy", b"no-referrer"),
        (b"cache-control", b"no-store"),
    ]
    if cookie is not None:
        value = f"{_name(page)}={cookie}; HttpOnly; SameSite=Strict; Path=/"  # Secure by TLS
        headers.append((b"set-cookie", value.encode()))
    await send({"type": "http.response.start", "status": 303, "headers": headers})
    await send({"type": "http.response.body", "body": b""})
