"""Who has no right is refused and written down; and no client, however rude, harms the record."""

import http.client
import socket
import sys
from pathlib import Path
from urllib.parse import quote

import numpy as np
import pytest
from faults.sessions import labcrane, unique, wait_for
from pages.room import STUDY, Room, a_room
from programs import ran

from labcrane import open_recording
from labcrane.testing import Order

RECONNECTS = 60

NOBODYS = (Order.DENIED,)
"""What pages say of themselves, and nobody may order."""


def ask(
    room: Room, method: str, path: str, cookie: str = "", body: str = ""
) -> tuple[int, str, str]:
    """Return status, cookie and text of an answer."""
    to = http.client.HTTPConnection("127.0.0.1", room.port, timeout=240)
    to.request(method, path, body, {"Cookie": cookie} if cookie else {})
    answer = to.getresponse()
    given = (answer.getheader("set-cookie") or "").partition(";")[0]
    read = answer.read().decode(errors="replace")
    to.close()
    return answer.status, given, read


def cookie_of(room: Room, page: str) -> str:
    status, cookie, _ = ask(room, "GET", room.links()[page].partition(str(room.port))[2])
    assert status == 303
    assert cookie
    return cookie


def socket_request(room: Room, cookie: str) -> bytes:
    """Return how a browser asks for a socket; it names the port with the host."""
    lines = [
        "GET /_nicegui_ws/socket.io/?EIO=4&transport=websocket HTTP/1.1",
        f"Host: 127.0.0.1:{room.port}",
        "Upgrade: websocket",
        "Connection: Upgrade",
        "Sec-WebSocket-Version: 13",
        "Sec-WebSocket-Key: MDEyMzQ1Njc4OWFiY2RlZg==",
        f"Cookie: {cookie}",
    ]
    return ("\r\n".join(lines) + "\r\n\r\n").encode()


def let_loose(room: Room, cookie: str) -> int:
    """Let a rude client loose; return how often it got in."""
    program = [sys.executable, str(Path(__file__).with_name("rude.py")), str(room.port)]
    arguments = [socket_request(room, cookie).decode(), cookie, str(RECONNECTS), "0"]
    done = ran([*program, *arguments], input="go\n", check=True)
    return int(done.stdout)


@pytest.fixture(scope="module")
def visited(tmp_path_factory: pytest.TempPathFactory):
    """Run a session, leave it alone, then ask for what may not be had, rudely; return all of it."""
    folder = tmp_path_factory.mktemp("rights")
    protocol = folder / "study.yaml"
    steps = "      - break: {seconds: 300}\n"
    protocol.write_text(STUDY.format(study=unique("rights"), steps=steps))
    answers = {}
    with a_room(protocol, folder / "data") as room:
        wait_for(lambda: room.process("pages"))
        supervisor, participant = cookie_of(room, "supervisor"), cookie_of(room, "participant")
        journal = room.folder / "ses-01_run.xdf"
        wait_for(lambda: journal.exists() and journal.stat().st_size > 100_000)
        answers["no token"] = ask(room, "GET", "/supervisor")
        answers["no token, a file"] = ask(room, "GET", "/_nicegui/3.0/static/nicegui.js")
        answers["wrong token"] = ask(room, "GET", "/supervisor?token=guess")
        answers["used token"] = ask(
            room, "GET", room.links()["supervisor"].partition(str(room.port))[2]
        )
        answers["participant's page token"] = ask(
            room,
            "GET",
            room.links()["participant"]
            .partition(str(room.port))[2]
            .replace("participant", "supervisor"),
        )
        answers["participant on supervisor page"] = ask(room, "GET", "/supervisor", participant)
        answers["participant's order"] = ask(room, "POST", "/orders/end", participant)
        answers["participant's report"] = ask(
            room, "POST", "/orders/report", participant, "deformity"
        )
        answers["participant's page"] = ask(room, "GET", "/participant", participant)
        answers["supervisor's note"] = ask(room, "POST", "/orders/note", supervisor, "seen")
        answers["no order"] = ask(room, "POST", "/orders/dance", supervisor)
        for word in sorted(NOBODYS):
            answers[f"said by no page itself: {word}"] = ask(
                room, "POST", f"/orders/{quote(word)}", supervisor, "x"
            )
        with socket.create_connection(("127.0.0.1", room.port)) as link:
            link.sendall(socket_request(room, f"labcrane-supervisor-{room.port}=guess"))
            answers["a socket without token"] = (int(link.recv(64).split()[1]), "", "")
        # Last: of so many refusals a second the record has a few and the number of the others.
        opened = let_loose(room, supervisor)
        assert ask(room, "POST", "/orders/end", supervisor)[0] == 202
        room.ended()
    session = open_recording(room.folder / "P001-PILOT.h5").session(1)
    return answers, session, opened


REFUSED = (
    "no token", "no token, a file", "wrong token", "used token", "participant's page token",
    "participant on supervisor page", "participant's order", "no order",
    *(f"said by no page itself: {word}" for word in sorted(NOBODYS)), "a socket without token",
)  # fmt: skip


@pytest.mark.slow
def test_without_the_right_token_nothing_is_given(visited) -> None:
    answers, *_ = visited
    assert {name: answers[name][0] for name in REFUSED} == dict.fromkeys(REFUSED, 403)
    assert answers["participant's page"][0] == 200
    assert answers["supervisor's note"][0] == 202


@pytest.mark.slow
def test_a_refusal_says_why_and_gives_nothing_away(visited) -> None:
    answers, *_ = visited
    text = answers["no token"][2]
    assert text == "labcrane: no token; use the link that labcrane has printed"
    assert answers["participant's order"][2] == (
        "the participant's page asked for end: no right to order it"
    )


@pytest.mark.slow
def test_every_refusal_is_in_the_record(visited) -> None:
    _, session, _ = visited
    events = session.events
    denied = [data["why"] for data in events[events["name"] == "page.denied"]["data"]]
    for why in (
        "127.0.0.1 asked for /supervisor: no token",
        "127.0.0.1 asked for /supervisor: a wrong or used token",
        "127.0.0.1 asked for /supervisor: no right to see it",
        "the participant's page asked for end: no right to order it",
        *(f"the experimenter's page asked for {word}: no right to order it" for word in NOBODYS),
        "127.0.0.1 asked for /_nicegui_ws/socket.io/: no token",
    ):
        assert why in denied
    notes = events[events["name"] == "order.note"]["data"].tolist()
    assert [(note["text"], note["by"]) for note in notes] == [("seen", "supervisor")]


@pytest.mark.slow
def test_clients_that_reconnect_and_never_read_get_in_and_take_no_tick(visited) -> None:
    # By how much they make the loop late is measured by benchmarks.beside.
    _, session, opened = visited
    assert opened == RECONNECTS
    ticks = session.streams["loop"].data["tick"].to_numpy()
    np.testing.assert_array_equal(ticks, np.arange(len(ticks)))


@pytest.mark.slow
def test_a_port_that_is_taken_says_what_to_do(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        steps = "      - break: {seconds: 1}\n"
        text = STUDY.format(study="taken", steps=steps) + f"page: {{port: {port}}}\n"
        (tmp_path / "study.yaml").write_text(text)
        run = labcrane(
            "run", tmp_path / "study.yaml", "--participant", "P001", "--pilot", "--local"
        )
        said, _ = run.communicate(timeout=240)
    assert run.returncode == 1
    assert f"the page cannot be served on 127.0.0.1:{port}: Address already in use" in said
