"""LSL examination: it distinguishes missing streams from blocked ones.

A stream is announced over UDP, described and sent over TCP, and its clock is queried over UDP
again; a firewall can block each separately. A test stream is examined first.
"""

import os
import select
import socket
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING
from xml.etree import ElementTree

from labcrane.core.findings import Finding, Verdict
from labcrane.streams.discovery import FoundStream, discover
from labcrane.streams.network import describe, free_ports, port_range
from labcrane.streams.request import StreamRequest

if TYPE_CHECKING:
    import pylsl

FIRST_PORT, PORTS = 16571, 34
"""liblsl's default: 16571 for discovery, and 16572 to 16604 for streams."""

ENOUGH_PORTS, FEWEST_PORTS = 20, 8
"""Ports that a run with page, recorders and three views uses; and the session alone."""

LOOK_S, LONGER_S = 2.0, 10.0
ANSWER_S = 1.5
OURS = "labcrane.doctor"
BYTES = 65536
OPEN_PORTS = "allow UDP 16571 and TCP and UDP 16572 to 16604, inbound and outbound"


def examine(requests: Sequence[StreamRequest] = ()) -> list[Finding]:
    """Search for a test stream and the streams of a study, and report trouble with any other."""
    import pylsl  # noqa: PLC0415 - liblsl reads its configuration when it is loaded

    room = ports_finding(free_ports(), len(port_range()))
    source_id = f"{OURS}-{os.getpid()}"
    outlet = pylsl.StreamOutlet(pylsl.StreamInfo(OURS, "Test", 1, 0.0, "float32", source_id))
    try:
        there = discover(LOOK_S)
        if not any(one.source_id == source_id for one in there):
            there = discover(LONGER_S)  # a busy computer answers late
    finally:
        del outlet
    own = [one for one in there if one.source_id == source_id]
    others = [one for one in there if one.name != OURS]
    found = [_self_test(own), room, *_needs(requests, others)]
    return [*found, *(finding for one in others for finding in _trouble(one))]


def ports_finding(free: int, of: int) -> Finding:
    """Report whether enough ports of liblsl's range are free for a run."""
    text = f"{free} of LSL's {of} ports are free"
    if free >= ENOUGH_PORTS:
        return Finding(Verdict.PASS, text)
    fix = (
        f"a run takes up to {ENOUGH_PORTS}: end programs that search for streams all the time, or "
        "set PortRange = 128 under [ports] in the lsl_api.cfg of every computer, and in firewalls"
    )
    verdict = Verdict.WARN if free >= FEWEST_PORTS else Verdict.FAIL
    return Finding(verdict, text, fix)


def _self_test(own: Sequence[FoundStream]) -> Finding:
    fix = f"the firewall of this computer blocks it: {OPEN_PORTS}"
    if not own:
        return Finding(Verdict.FAIL, "a test stream is not found (UDP 16571)", fix)
    if own[0].warnings and (blocked := _blocked(own[0])):
        return Finding(Verdict.FAIL, f"a test stream {blocked}", fix)
    return Finding(Verdict.PASS, f"a test stream is found and answers; {describe()}")


def _blocked(one: FoundStream) -> str:
    """Return which part of a stream is blocked, in words; empty if none is."""
    if not one.format:
        return "is announced but does not send its description: TCP is blocked"
    return "" if one.offset_s is not None else "does not answer clock probes: UDP is blocked"


def _trouble(one: FoundStream) -> Iterator[Finding]:
    for warning in one.warnings:
        what, _, fix = warning.partition(": ")
        yield Finding(Verdict.WARN, f"stream {one.name!r} on {one.host} {what}", fix)


def _needs(requests: Sequence[StreamRequest], there: Sequence[FoundStream]) -> Iterator[Finding]:
    for request in requests:
        fitting = [one for one in there if request.matches(_info(one))]
        if not fitting:
            verdict = Verdict.FAIL if request.required else Verdict.WARN
            fix = (
                "start its program; if it runs on another computer, labcrane doctor --peer ADDRESS "
                "checks for a firewall in between"
            )
            yield Finding(verdict, f"stream {request} is not announced", fix)
        yield from _whose(request, fitting)
        for one in fitting:
            blocked, misfits = _blocked(one), request.misfits(one.channels, one.rate_hz)
            text = f"stream {request} comes from {one.host}"
            if blocked:
                fix = f"a firewall on {one.host} or here blocks it: {OPEN_PORTS}"
                yield Finding(Verdict.FAIL, f"{text}, {blocked}", fix)
            elif misfits:
                fix = "correct the program's settings or the protocol"
                yield Finding(Verdict.FAIL, f"{text}, but it {' and '.join(misfits)}", fix)
            else:
                yield Finding(Verdict.PASS, text)
                yield from _declared(request, one)


def _declared(request: StreamRequest, one: FoundStream) -> Iterator[Finding]:
    """Propose how the protocol can declare the stream of a known program."""
    program = one.program
    if program is None:
        return
    said = {key: getattr(request, key) for key in program.declared}
    if said != program.declared:
        text = f"stream {request} looks like that of {program.name}, which {program.stamps}"
        new = ", ".join(f"{key}: {value}" for key, value in program.declared.items())
        old = ", ".join(f"{key}: {value}" for key, value in said.items() if value)
        fix = f"write {new} for it in the protocol{f' in place of {old}' if old else ''}"
        yield Finding(Verdict.WARN, text, fix)


def _whose(request: StreamRequest, fitting: Sequence[FoundStream]) -> Iterator[Finding]:
    """Name the matching streams, where several match or the request is by type only."""
    if request.several or not fitting:
        return
    which = "; ".join(
        f"{one.name!r} (source_id {one.source_id!r}) of {one.host}" for one in fitting
    )
    if request.asks:
        text = f"stream {request} is requested by type only, and a run asks for confirmation: "
        fix = "set the source_id of the right stream in the protocol"
        meant = request.any_meant and len(fitting) == 1
        yield Finding(Verdict.PASS if meant else Verdict.WARN, f"{text}{which}", fix)
    elif len(fitting) > 1:
        fix = "set the source_id of the right stream in the protocol, or several: true"
        text = f"stream {request} matches {len(fitting)} streams, so no run begins: {which}"
        yield Finding(Verdict.FAIL if request.required else Verdict.WARN, text, fix)


def _info(one: FoundStream) -> "pylsl.StreamInfo":
    import pylsl  # noqa: PLC0415

    return pylsl.StreamInfo(one.name, one.type, one.channels, one.rate_hz, "float32", one.source_id)


def ask_peer(host: str, first_port: int = FIRST_PORT, wait_s: float = ANSWER_S) -> list[Finding]:
    """Query a computer for its streams as liblsl does, and explain a missing answer.

    The other computer refuses a port without a listener; a firewall does not answer.
    """
    try:
        address = socket.gethostbyname(host)
    except OSError as error:
        fix = "correct its name, or give its address"
        return [Finding(Verdict.FAIL, f"{host} has no address: {error}", fix)]
    answers, refused = _ask(address, range(first_port, first_port + PORTS), wait_s)
    if answers:
        return [_reached(host, address, answer) for answer in answers.values()]
    if refused:
        fix = "start the program that sends the stream, on that computer"
        text = f"{host} is reachable and lets LSL through, but no program sends a stream there"
        return [Finding(Verdict.FAIL, text, fix)]
    text = f"{host} does not answer on UDP {first_port} to {first_port + PORTS - 1}"
    fix = f"if ping {host} is answered, a firewall blocks LSL: {OPEN_PORTS}, there and here"
    return [Finding(Verdict.FAIL, text, fix)]


def _ask(address: str, ports: range, wait_s: float) -> tuple[dict[str, ElementTree.Element], bool]:
    """Return the streams that answer, by their uid, and whether any port was refused."""
    answers: dict[str, ElementTree.Element] = {}
    refused = False
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("", 0))
        back = receiver.getsockname()[1]
        query = f"LSL:shortinfo\r\nuid\r\n{back} 1\r\n".encode()
        senders = [_send(address, port, query) for port in ports]
        try:
            waiting = [receiver, *senders]
            while waiting and (ready := select.select(waiting, [], [], wait_s)[0]):
                for each in ready:
                    try:
                        text = each.recv(BYTES).decode(errors="replace")
                    except (ConnectionRefusedError, ConnectionResetError):  # Windows says reset
                        refused = True
                        waiting.remove(each)
                        continue
                    try:
                        info = ElementTree.fromstring(text.partition("\r\n")[2])  # noqa: S314 - the lab's own network
                    except ElementTree.ParseError:  # another program's query
                        continue
                    answers[info.findtext("uid") or text] = info
        finally:
            for each in senders:
                each.close()
    return answers, refused


def _send(address: str, port: int, query: bytes) -> socket.socket:
    """Send a query from a socket of its own, which hears when the port is refused."""
    sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sender.connect((address, port))
    sender.send(query)
    return sender


def _reached(host: str, address: str, info: ElementTree.Element) -> Finding:
    name, port = info.findtext("name"), int(info.findtext("v4data_port") or 0)
    try:
        socket.create_connection((address, port), ANSWER_S).close()
    except OSError as error:
        fix = f"a firewall on {host} or here blocks it: {OPEN_PORTS}"
        text = f"stream {name!r} on {host} is announced, but TCP {port} is not open: {error}"
        return Finding(Verdict.FAIL, text, fix)
    return Finding(Verdict.PASS, f"stream {name!r} on {host} answers on UDP and on TCP {port}")
