"""Who has no right is refused and written down; and no client, however rude, slows the loop."""

import http.client
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

import numpy as np
import pytest
from faults.sessions import labcrane, unique, wait_for
from pages.room import STUDY, Room, a_room

from labcrane import open_recording
from labcrane.recording.participant_file.reader import SessionRecord
from labcrane.session.commands import FAULTS

RATE_HZ = 240
SPELL_S = 0.7
SPELLS = 10
"""Quiet and rude spells take turns, so that what else the computer does falls on both alike."""

LATER_S = 0.25 / RATE_HZ
""""Unchanged": less than this, where a tick lasts four times as long."""

RECONNECTS = 200


@dataclass(frozen=True)
class Spell:
    """From when to when, and the seconds of CPU that each process used."""

    start: float
    end: float
    used: dict[str, float]


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


class Burden:
    """What a spell costs the session's process and the pages', in seconds of CPU per second."""

    def __init__(self, room: Room) -> None:
        self._processes = {word: room.process(word) for word in ("session", "pages")}

    def during(self, spell: Callable[[], None]) -> Spell:
        start, before = time.perf_counter(), self._used()
        spell()
        end, after = time.perf_counter(), self._used()
        return Spell(start, end, {word: after[word] - before[word] for word in after})

    def _used(self) -> dict[str, float]:
        times = {word: process.cpu_times() for word, process in self._processes.items()}
        return {word: of.user + of.system for word, of in times.items()}


def taking_turns(room: Room, cookie: str) -> tuple[int, list[Spell], list[Spell]]:
    """Leave the session alone and let a rude client loose, in turn; how often did it get in?"""
    program = [sys.executable, str(Path(__file__).with_name("rude.py")), str(room.port)]
    request = socket_request(cookie).decode()
    arguments = [request, cookie, str(RECONNECTS // SPELLS), str(SPELL_S)]
    burden, opened, quiet, rude = Burden(room), [], [], []
    with subprocess.Popen(
        [*program, *arguments], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as client:

        def let_loose() -> None:
            client.stdin.write("go\n")
            client.stdin.flush()
            opened.append(int(client.stdout.readline()))

        for _ in range(SPELLS):
            quiet.append(burden.during(lambda: time.sleep(SPELL_S)))
            rude.append(burden.during(let_loose))
        client.stdin.close()
    return sum(opened), quiet, rude


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
        answers["participant's page"] = ask(room, "GET", "/participant", participant)
        answers["supervisor's note"] = ask(room, "POST", "/orders/note", supervisor, "seen")
        answers["no order"] = ask(room, "POST", "/orders/dance", supervisor)
        for word in sorted(FAULTS):
            answers[f"said by the launcher only: {word}"] = ask(
                room, "POST", f"/orders/{quote(word)}", supervisor, "x"
            )
        spells = taking_turns(room, supervisor)
        with socket.create_connection(("127.0.0.1", room.port)) as link:
            link.sendall(socket_request("labcrane-supervisor=guess"))
            answers["a socket without token"] = (int(link.recv(64).split()[1]), "", "")
        assert ask(room, "POST", "/orders/end", supervisor)[0] == 202
        room.ended()
    session = open_recording(room.folder / "P001-PILOT.h5").session(1)
    return answers, session, spells


REFUSED = (
    "no token", "no token, a file", "wrong token", "used token", "participant's page token",
    "participant on supervisor page", "participant's order", "no order",
    *(f"said by the launcher only: {word}" for word in sorted(FAULTS)), "a socket without token",
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
    _, session, _ = visited
    events = session.events
    denied = [data["why"] for data in events[events["name"] == "page.denied"]["data"]]
    for why in (
        "127.0.0.1 asked for /supervisor: no token",
        "127.0.0.1 asked for /supervisor: a wrong or used token",
        "127.0.0.1 asked for /supervisor: no right to see it",
        "the participant page asked for end: no right to order it",
        *(f"the supervisor page asked for {word}: no right to order it" for word in FAULTS),
        "127.0.0.1 asked for /_nicegui_ws/socket.io/: no token",
    ):
        assert why in denied
    notes = events[events["name"] == "order.note"]["data"].tolist()
    assert [(note["text"], note["by"]) for note in notes] == [("seen", "supervisor")]


def test_two_hundred_reconnects_and_a_client_that_never_reads_do_not_slow_the_loop(visited) -> None:
    """Ten times in turn; the median turn counts, for something else may run in one of them."""
    _, session, (opened, quiet, rude) = visited
    assert opened == RECONNECTS
    before, during = lateness(session, quiet), lateness(session, rude)
    later = during - before
    assert np.median(later) < LATER_S, f"ms: quiet {1e3 * before}, later each time by {1e3 * later}"
    assert len(later) == SPELLS


def test_what_rude_clients_cost_is_paid_by_the_pages_and_not_by_the_loop(visited) -> None:
    _, _, (_, quiet, rude) = visited
    extra = {word: share(rude, word) - share(quiet, word) for word in ("session", "pages")}
    assert extra["pages"] > 0.1, "two hundred page loads cannot be that cheap"
    assert extra["session"] < 0.25 * extra["pages"]


def lateness(session: SessionRecord, spells: list[Spell]) -> np.ndarray:
    """Return the 99th percentile of lateness in each spell, in s."""
    loop = session.streams["loop"].data
    late, due = (loop["woke"] - loop["due"]).to_numpy(), loop["due"].to_numpy()
    inside = [late[(due >= spell.start) & (due < spell.end)] for spell in spells]
    assert min(map(len, inside)) > 0.9 * SPELL_S * RATE_HZ
    return np.array([np.quantile(each, 0.99) for each in inside])


def share(spells: list[Spell], word: str) -> float:
    """Return how much of a CPU a process used."""
    return sum(s.used[word] for s in spells) / sum(s.end - s.start for s in spells)


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
