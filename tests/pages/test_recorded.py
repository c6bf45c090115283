"""Pages of a session that was begun under older rules."""

import http.client
import random
from contextlib import closing
from pathlib import Path

import pytest
from faults.sessions import unique, wait_for
from recording.test_outdated import faulty

from labcrane import ProtocolError
from labcrane.testing import discover, load
from labcrane.web.handle import PageHandle, free_port
from labcrane.web.server.access import NAMES
from labcrane.web.service import PageConfig
from labcrane.web.state import SessionLeft

HOST = "127.0.0.1"


def answer(port: int, path: str, cookie: str = "") -> tuple[int, str, str]:
    with closing(http.client.HTTPConnection(HOST, port, timeout=240)) as to:
        to.request("GET", path, headers={"Cookie": cookie} if cookie else {})
        got = to.getresponse()
        return got.status, got.getheader("set-cookie") or "", got.read().decode()


@pytest.mark.slow
def test_pages_show_a_session_whose_protocol_would_be_refused_today(tmp_path: Path) -> None:
    names = ["twice", "two_of_a_name", "no_writing", "stream_device", "no_bus"]
    path = faulty(tmp_path, random.Random(3), names)
    with pytest.raises(ProtocolError):
        load(path, discover(study=path))
    said: list[str] = []
    port = free_port(HOST, 0)
    order = PageConfig(path, "P001", "P001", 1, unique("old"), HOST, port, recorded=True)
    pages = PageHandle(order, lambda _: None, said.append, dict)
    link = pages.links()["supervisor"]
    try:
        wait_for(lambda: len(said) >= len(pages.links()))
        assert said == [f"{NAMES[page]}'s page: {each}" for page, each in pages.links().items()]
        status, cookie, _ = answer(port, link.partition(str(port))[2])
        assert status == 303
        status, _, shown = answer(port, "/supervisor", cookie.partition(";")[0])
        assert status == 200
        assert "P001" in shown
    finally:
        pages.close(SessionLeft("ok", "over"))
    assert pages.restarts == 0
