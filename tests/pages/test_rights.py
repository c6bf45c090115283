"""Who has no right is refused and written down; and no client, however rude, slows the loop."""

import http.client
import socket
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from faults.sessions import labcrane, unique, wait_for
from pages.room import STUDY, Room, a_room

from labcrane import open_recording

RATE_HZ = 240
SPELL_S = 3.0
SPELLS = 4
"""Quiet and rude spells take turns, so that what else the computer does falls on both alike."""

RECONNECTS = 200


def ask(
    room: Room, method: str, path: str, cookie: str = "", body: str = ""
) -> tuple[int, str, str]:
    """Return status, cookie and text of an answer."""
    to = http.client.HTTPConnection("127.0.0.1", room.port, timeout=20)
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


def socket_request(cookie: str, path: str = "/_nicegui_ws/socket.io/") -> bytes:
    lines = [
        f"GET {path}?EIO=4&transport=websocket HTTP/1.1",
        "Host: 127.0.0.1",
        "Upgrade: websocket",
        "Connection: Upgrade",
        "Sec-WebSocket-Version: 13",
        "Sec-WebSocket-Key: MDEyMzQ1Njc4OWFiY2RlZg==",
        f"Cookie: {cookie}",
    ]
    return ("\r\n".join(lines) + "\r\n\r\n").encode()


def rudely(room: Room, cookie: str) -> int:
    """Let a rude client loose for a spell; return how often it got in."""
    program = [sys.executable, str(Path(__file__).with_name("rude.py")), str(room.port)]
    request = socket_request(cookie).decode()
    arguments = [request, str(RECONNECTS // SPELLS), str(SPELL_S)]
    done = subprocess.run([*program, *arguments], capture_output=True, text=True, check=True)
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
        wait_for(lambda: room.process("pages"), 60)
        supervisor, participant = cookie_of(room, "supervisor"), cookie_of(room, "participant")
        journal = room.folder / "ses-01_run.xdf"
        wait_for(lambda: journal.exists() and journal.stat().st_size > 100_000, 60)
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
        answers["participant's page"] = ask(room, "GET", "/participant", participant)
        answers["supervisor's note"] = ask(room, "POST", "/orders/note", supervisor, "seen")
        answers["no order"] = ask(room, "POST", "/orders/dance", supervisor)
        answers["said by the launcher only"] = ask(room, "POST", "/orders/lost", supervisor, "x")
        opened, spells = 0, []
        for _ in range(SPELLS):
            quiet = time.perf_counter()
            time.sleep(SPELL_S)
            rude = time.perf_counter()
            opened += rudely(room, supervisor)
            spells.append((quiet, rude, time.perf_counter()))
        with socket.create_connection(("127.0.0.1", room.port)) as link:
            link.sendall(socket_request("labcrane-supervisor=guess"))
            answers["a socket without token"] = (int(link.recv(64).split()[1]), "", "")
        assert ask(room, "POST", "/orders/end", supervisor)[0] == 202
        assert room.launcher.wait(60) == 0, "".join(room.said)
    session = open_recording(room.folder / "P001-PILOT.h5").session(1)
    return answers, opened, session, spells


REFUSED = (
    "no token", "no token, a file", "wrong token", "used token", "participant's page token",
    "participant on supervisor page", "participant's order", "no order",
    "said by the launcher only", "a socket without token",
)  # fmt: skip


def test_without_the_right_token_nothing_is_given(visited) -> None:
    answers, *_ = visited
    assert {name: answers[name][0] for name in REFUSED} == dict.fromkeys(REFUSED, 403)
    assert answers["participant's page"][0] == 200
    assert answers["supervisor's note"][0] == 202


def test_a_refusal_says_why_and_gives_nothing_away(visited) -> None:
    answers, *_ = visited
    text = answers["no token"][2]
    assert text == "labcrane: no token; use the link that labcrane run has printed"
    assert answers["participant's order"][2] == "the participant page has no right to order end"


def test_every_refusal_is_in_the_record(visited) -> None:
    _, _, session, _ = visited
    events = session.events
    denied = [data["why"] for data in events[events["name"] == "page.denied"]["data"]]
    for why in (
        "127.0.0.1 asked for /supervisor: no token",
        "127.0.0.1 asked for /supervisor: a wrong or used token",
        "127.0.0.1 asked for /supervisor: no right to see it",
        "the participant page asked for end: no right to order it",
        "the supervisor page asked for lost: no right to order it",
        "127.0.0.1 asked for /_nicegui_ws/socket.io/: no token",
    ):
        assert why in denied
    notes = events[events["name"] == "order.note"]["data"].tolist()
    assert [(note["text"], note["by"]) for note in notes] == [("seen", "supervisor")]


def test_two_hundred_reconnects_and_a_client_that_never_reads_do_not_slow_the_loop(visited) -> None:
    _, opened, session, spells = visited
    assert opened == RECONNECTS
    loop = session.streams["loop"].data
    late = (loop["woke"] - loop["due"]).to_numpy()
    due = loop["due"].to_numpy()
    before = [seconds(late[(due >= quiet) & (due < rude)]) for quiet, rude, _ in spells]
    during = [seconds(late[(due >= rude) & (due < calm)]) for _, rude, calm in spells]
    assert usual(during) <= usual(before) + 0.25 / RATE_HZ


def seconds(late: np.ndarray) -> np.ndarray:
    """Return the 99th percentile of lateness in each whole second, in s."""
    whole = late[: len(late) // RATE_HZ * RATE_HZ].reshape(-1, RATE_HZ)
    return np.quantile(whole, 0.99, axis=1)


def usual(spells: list[np.ndarray]) -> float:
    """Return the lateness of the median second."""
    every = np.concatenate(spells)
    assert len(every) >= SPELLS * (SPELL_S - 1)
    return float(np.median(every))


def test_a_port_that_is_taken_says_what_to_do(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        steps = "      - break: {seconds: 1}\n"
        text = STUDY.format(study="taken", steps=steps) + f"page: {{port: {port}}}\n"
        (tmp_path / "study.yaml").write_text(text)
        run = labcrane(
            "run", tmp_path / "study.yaml", "--participant", "P001", "--pilot", "--local"
        )
        said, _ = run.communicate(timeout=60)
    assert run.returncode == 1
    assert f"the page cannot be served on 127.0.0.1:{port}: Address already in use" in said
