"""An attack on the pages of a session, from other addresses, while the examiner writes notes."""

import contextlib
import os
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field

import psutil
from pages.room import Room
from pages.test_rights import ask, socket_request

HOST = "127.0.0.1"
SILENT, SLOW = 300, 60


@dataclass
class Siege:
    """What was answered.

    Attributes
    ----------
    answers
        How the answers to each kind of request begin.
    notes
        Status of each of the examiner's notes, in order.
    delays
        How long each of them took, in seconds.
    spent
        How long the pages' process computed meanwhile, in seconds: what a note would have waited
        for on a computer that nobody else keeps busy.
    """

    answers: dict[str, list[bytes]] = field(default_factory=dict)
    notes: list[int] = field(default_factory=list)
    delays: list[float] = field(default_factory=list)
    spent: list[float] = field(default_factory=list)


def attack(
    room: Room, cookie: str, guest: str, seconds: float, notes_s: float = 0.2, denied: int = 0
) -> Siege:
    """Attack for some seconds: denied, huge and allowed requests, slow readers, sockets, messages.

    Parameters
    ----------
    guest
        The cookie of somebody who may see a page, and asks for it without an end.
    denied
        So many refusals there must be, however long that takes: on a busy computer an attack is
        slow as well.
    """
    siege, pages = Siege(), room.process("pages")
    assert pages is not None
    head = f"Host: {HOST}:{room.port}\r\n"
    huge = f"POST /orders/note HTTP/1.1\r\n{head}Cookie: {cookie}\r\nContent-Length: 226000000"
    allowed = f"GET /participant HTTP/1.1\r\n{head}Cookie: {guest}\r\nConnection: close\r\n\r\n"
    forbidden = f"GET /supervisor HTTP/1.1\r\n{head}\r\n"
    kinds = {
        "denied": forbidden,
        "also denied": forbidden,
        "huge": f"{huge}\r\n\r\n",
        "allowed": allowed,
    }
    over = threading.Event()
    with ExitStack() as stack:
        for at, (kind, request) in enumerate(kinds.items()):
            answers = siege.answers.setdefault(kind, [])
            source = f"127.0.0.{3 + at}"
            stack.enter_context(meanwhile(over, flood, room.port, request, source, answers))
        said = siege.answers.setdefault("messages", [])
        stack.enter_context(meanwhile(over, chatter, room, guest, "127.0.0.9", said))
        for _ in range(SILENT):
            stack.enter_context(contextlib.closing(other(room.port, "127.0.0.2")))
        for _ in range(SLOW):
            reader = stack.enter_context(contextlib.closing(other(room.port, "127.0.0.8")))
            reader.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            with contextlib.suppress(OSError):
                reader.sendall(allowed.encode())  # and never reads
        ends = time.monotonic() + seconds
        while time.monotonic() < ends or len(siege.answers["denied"]) < denied:
            began, computed = time.monotonic(), processor_s(pages)
            note = f"note {len(siege.notes)}"
            siege.notes.append(ask(room, "POST", "/orders/note", cookie, note)[0])
            siege.delays.append(time.monotonic() - began)
            siege.spent.append(processor_s(pages) - computed)
            time.sleep(notes_s)
        over.set()
    return siege


def processor_s(process: psutil.Process) -> float:
    times = process.cpu_times()
    return float(times.user + times.system)


@contextmanager
def meanwhile(over: threading.Event, what: Callable[..., None], *given: object) -> Iterator[None]:
    thread = threading.Thread(target=what, args=(over, *given))
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def other(port: int, source: str) -> socket.socket:
    return socket.create_connection((HOST, port), 20, (source, 0))


def flood(
    over: threading.Event, port: int, request: str, source: str, answers: list[bytes]
) -> None:
    """Send a request again and again, and read how each answer begins."""
    while not over.is_set():
        with contextlib.suppress(OSError), other(port, source) as link:
            link.sendall(request.encode())
            answers.append(link.recv(12))


def chatter(
    over: threading.Event, room: Room, cookie: str, source: str, answers: list[bytes]
) -> None:
    """Open a page's socket and send messages as fast as they go, some larger than may be."""
    while not over.is_set():
        with contextlib.suppress(OSError), other(room.port, source) as link:
            link.sendall(socket_request(room, cookie))
            answers.append(link.recv(12))
            for number in range(400):
                link.sendall(frame(b'42["event",{"id":0}]' if number % 50 else b"4" * 100_000))
                if over.is_set():
                    return


def frame(text: bytes) -> bytes:
    """Return a text as a browser's frame of a web socket: masked."""
    mask = os.urandom(4)
    size = len(text)
    head = bytes([0x81, 0x80 | size]) if size < 126 else b"\x81\xff" + struct.pack(">Q", size)
    whole = (mask * (size // 4 + 1))[:size]
    masked = int.from_bytes(text, "big") ^ int.from_bytes(whole, "big")
    return head + mask + masked.to_bytes(size, "big")
