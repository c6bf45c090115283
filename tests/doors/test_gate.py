"""The pages' gate by itself: tokens, cookies and refusals, without a server."""

import asyncio
from typing import Any

from labcrane.web.server.access import SCOPE, AccessKeys, Gate


class Door:
    """A gate before a page that says who may see it, and what the gate has said."""

    def __init__(self, port: int = 8080, *, secure: bool = False) -> None:
        self.keys = AccessKeys()
        self.used: list[str] = []
        self.denied: list[str] = []
        self.gate = Gate(
            _page, self.keys, self.used.append, self.denied.append, port, secure=secure
        )

    def ask(self, path: str, token: str = "", cookie: bytes = b"") -> tuple[int, dict, bytes]:
        """Return status, headers and body of the answer."""
        sent: list[dict[str, Any]] = []

        async def send(message: dict[str, Any]) -> None:
            sent.append(message)

        scope = {
            "type": "http",
            "path": path,
            "query_string": f"token={token}".encode() if token else b"",
            "headers": [(b"cookie", cookie)] if cookie else [],
            "client": ("10.0.0.7", 5),
        }
        asyncio.run(self.gate(scope, _nothing_comes, send))
        start, *rest = sent
        return start["status"], dict(start["headers"]), b"".join(one["body"] for one in rest)


async def _page(scope: Any, receive: Any, send: Any) -> None:
    await send({"type": "http.response.start", "status": 200, "headers": []})
    await send({"type": "http.response.body", "body": " ".join(sorted(scope[SCOPE])).encode()})


async def _nothing_comes() -> Any:
    raise AssertionError("a gate reads no body")


def test_a_token_is_exchanged_once_for_a_cookie_that_opens_its_page_and_no_other() -> None:
    door = Door(secure=True)
    token = door.keys.tokens["supervisor"]
    status, headers, _ = door.ask("/supervisor", token)
    assert (status, headers[b"location"], door.used) == (303, b"/supervisor", ["supervisor"])
    assert headers[b"referrer-policy"] == b"no-referrer"
    cookie, *words = headers[b"set-cookie"].split(b"; ")
    assert {word.lower() for word in words} == {
        b"httponly",
        b"path=/",
        b"samesite=strict",
        b"secure",
    }
    assert door.ask("/supervisor", cookie=cookie) == (200, {}, b"supervisor")
    assert door.ask("/supervisor", token, cookie)[0] == 303, "a reload of the link"
    assert door.ask("/supervisor", token)[0] == 403
    status, _, said = door.ask("/participant", cookie=cookie)
    assert (status, said.partition(b";")[0]) == (403, b"labcrane: no right to see it")
    assert door.denied[-1] == "10.0.0.7 asked for /participant: no right to see it"


def test_a_cookie_that_cannot_be_read_does_not_cost_the_others() -> None:
    door = Door()
    ours = f"labcrane-participant-8080={door.keys.cookies['participant']}".encode()
    for others in (b"a b=1", b"=", b"x=\xff\xfe", b'"', b"labcrane-supervisor-8080="):
        assert door.ask("/participant", cookie=others + b"; " + ours) == (200, {}, b"participant")
        assert door.ask("/participant", cookie=others)[0] == 403


def test_what_is_served_at_another_port_takes_nobody_s_right_to_see_the_first() -> None:
    """A browser keeps one jar of cookies for all ports of a host, by their names."""
    doors, jar = (Door(8080), Door(8081)), {}
    for door in doors:
        _, headers, _ = door.ask("/supervisor", door.keys.tokens["supervisor"])
        name, _, value = headers[b"set-cookie"].partition(b";")[0].partition(b"=")
        jar[name] = value
    cookies = b"; ".join(b"=".join(pair) for pair in jar.items())
    for door in doors:
        assert door.ask("/supervisor", cookie=cookies) == (200, {}, b"supervisor")
        assert door.ask("/participant", cookie=cookies)[0] == 403
    swapped = cookies.replace(b"-8080=", b"-x=").replace(b"-8081=", b"-8080=")
    assert doors[0].ask("/supervisor", cookie=swapped)[0] == 403, "one's secret opens no other"
