"""A stream that is missing is told apart from one that is blocked, with real LSL on loopback."""

import os
import socket
import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from xml.etree import ElementTree

import pylsl
import pytest
from programs import ran
from recording.test_full_disk import needs_mounts

from labcrane.core import Finding, Verdict
from labcrane.doctor import lsl
from labcrane.streams.known_programs import KNOWN
from labcrane.streams.network import free_ports, port_range
from labcrane.streams.request import StreamRequest

HOST = "127.0.0.1"
NAME = f"Doctors test {os.getpid()}"


@pytest.fixture(scope="module")
def outlet() -> pylsl.StreamOutlet:
    return pylsl.StreamOutlet(pylsl.StreamInfo(NAME, "EEG", 4, 250.0, "float32", "amplifier-7"))


def about(found: list[Finding], word: str) -> Finding:
    (one,) = [finding for finding in found if word in finding.text]
    return one


@pytest.mark.slow
def test_streams_that_are_there_missing_or_wrong_are_told_apart(
    outlet: pylsl.StreamOutlet,
) -> None:
    found = lsl.examine(
        [
            StreamRequest("eeg", name=NAME, rate_hz=250.0, channels=4),
            StreamRequest("gaze", name="No such stream"),
            StreamRequest("maybe", name="Nor this", required=False),
            StreamRequest("wrong", name=NAME, channels=32),
        ]
    )
    assert about(found, "a test stream").verdict is Verdict.PASS
    assert "this computer only" in about(found, "a test stream").text
    assert about(found, "stream eeg").verdict is Verdict.PASS
    missing = about(found, "gaze")
    assert missing.verdict is Verdict.FAIL
    assert missing.text == "stream gaze (name 'No such stream') is not announced"
    assert "labcrane doctor --peer" in missing.advice
    assert about(found, "maybe").verdict is Verdict.WARN
    assert "has 4 channels; 32 are expected" in about(found, "wrong").text


@pytest.mark.slow
def test_a_stream_asked_for_by_its_type_alone_is_asked_about_and_rivals_are_refused() -> None:
    mine, his = (
        pylsl.StreamOutlet(pylsl.StreamInfo(f"{NAME} twin", "DoctorEEG", 4, 250.0, "float32", who))
        for who in ("mine", "his")
    )
    other = pylsl.StreamOutlet(
        pylsl.StreamInfo(f"{NAME} gaze", "DoctorGaze", 2, 60.0, "float32", "tracker-1")
    )
    found = lsl.examine(
        [
            StreamRequest("eeg", type="DoctorEEG"),
            StreamRequest("either", name=f"{NAME} twin"),
            StreamRequest("all", type="DoctorEEG", several=True),
            StreamRequest("gaze", type="DoctorGaze"),
            StreamRequest("any", type="DoctorGaze", any_meant=True),
            StreamRequest("known", source_id="tracker-1"),
        ]
    )
    del mine, his, other
    rivals, either = (
        about(found, "matches 2 streams"),
        about(found, "stream eeg (type 'DoctorEEG') is"),
    )
    assert (rivals.verdict, either.verdict) == (Verdict.FAIL, Verdict.WARN)
    assert "stream either (name " in rivals.text
    assert "matches 2 streams, so no run begins: " in rivals.text
    assert "is requested by type only, and a run asks for confirmation: " in either.text
    for who in ("mine", "his"):
        for one in (rivals, either):
            assert f"{f'{NAME} twin'!r} (source_id {who!r}) of " in one.text
    assert rivals.advice.startswith("set the source_id of the right stream")
    asked, meant = (
        about(found, f"stream {label} (type 'DoctorGaze') is") for label in ("gaze", "any")
    )
    assert (asked.verdict, meant.verdict) == (Verdict.WARN, Verdict.PASS)
    assert f"and a run asks for confirmation: {f'{NAME} gaze'!r}" in asked.text
    assert asked.advice == "set the source_id of the right stream in the protocol"
    assert not [one for one in found if "stream all" in one.text and "any of" in one.text]
    assert not [one for one in found if "stream known" in one.text and "asks" in one.text]


@pytest.mark.slow
def test_the_stream_of_a_known_program_gets_a_proposal_for_the_protocol() -> None:
    made = []
    for name, source, maker in (
        ("EyeLogic", f"EyeLogic One | {os.getpid()}", "EyeLogic"),
        ("BrainAmpSeries-0", f"BrainAmpSeries-0_{os.getpid()}", "Brain Products"),
        ("EyeLogic", f"another {os.getpid()}", "labcrane"),
    ):
        info = pylsl.StreamInfo(name, "Known", 2, 250.0, "float32", source)
        info.desc().append_child("acquisition").append_child_value("manufacturer", maker)
        made.append((source, pylsl.StreamOutlet(info)))
    gaze, eeg, other = (source for source, _ in made)
    found = lsl.examine(
        [
            StreamRequest("gaze", source_id=gaze, stamped="when_sent"),
            StreamRequest("eeg", source_id=eeg),
            StreamRequest("right", source_id=eeg, stamped="when_sent"),
            StreamRequest("other", source_id=other),
        ]
    )
    told = {one.text.split()[1]: one for one in found if "looks like that of" in one.text}
    assert set(told) == {"gaze", "eeg"}
    assert told["gaze"].advice == (
        "write stamped: at_sampling, counter: FrameNumber for it in the protocol in place of "
        "stamped: when_sent"
    )
    assert told["eeg"].text.endswith(
        "looks like that of App-BrainAmpSeries, which stamps a chunk with the time at which it "
        "read it"
    )
    assert told["eeg"].advice == "write stamped: when_sent for it in the protocol"
    del made


def test_each_known_program_is_in_the_docs_with_what_to_declare() -> None:
    page = (Path(__file__).parents[2] / "docs" / "devices.md").read_text(encoding="utf-8")
    rows = [line for line in page.splitlines() if line.startswith("| `")]
    expected = [
        f"| `{program.name}` | {program.stamps} | "
        f"{', '.join(f'`{key}: {value}`' for key, value in program.declared.items())} | "
        f"`{program.source}` |"
        for program in KNOWN
    ]
    assert [
        row for row in rows if row.startswith(tuple(f"| `{p.name}`" for p in KNOWN))
    ] == expected


def test_ports_that_others_have_taken_are_counted() -> None:
    before = free_ports()
    with ExitStack() as held:
        for port in port_range():
            for kind in (socket.SOCK_DGRAM, socket.SOCK_STREAM):
                each = held.enter_context(socket.socket(socket.AF_INET, kind))
                with suppress(OSError):  # another program has it
                    each.bind(("", port))
        assert free_ports() == 0 < before


def test_too_few_free_ports_are_a_finding_that_says_what_to_do() -> None:
    enough, few, none = (lsl.ports_finding(free, 32) for free in (32, 12, 0))
    assert (enough.verdict, few.verdict, none.verdict) == (
        Verdict.PASS,
        Verdict.WARN,
        Verdict.FAIL,
    )
    assert few.text == "12 of LSL's 32 ports are free"
    assert "end programs that search for streams all the time" in few.advice
    assert "PortRange = 128 under [ports]" in few.advice


@pytest.mark.slow
@needs_mounts
def test_our_own_stream_is_not_found_when_nothing_gets_through() -> None:
    # In a network of its own in which not even loopback is up.
    code = (
        "from labcrane.doctor import lsl\n"
        "for one in lsl.examine(): print(one.verdict, one.text, '|', one.advice)"
    )
    done = ran(
        ["unshare", "--user", "--map-root-user", "--net", sys.executable, "-c", code], check=True
    )
    assert done.stdout.startswith("FAIL a test stream is not found (UDP 16571) | the fire")


@contextmanager
def mute_ports(count: int) -> Iterator[int]:
    """Hold consecutive UDP ports that take everything and say nothing, as a firewall does."""
    with ExitStack() as held:
        for first in range(36000, 60000, count):
            try:
                for port in range(first, first + count):
                    each = held.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
                    each.bind((HOST, port))
            except OSError:
                continue
            yield first
            return


def test_silence_is_a_firewall_and_a_refusal_is_a_missing_program() -> None:
    with mute_ports(lsl.PORTS) as first:
        (silent,) = lsl.ask_peer(HOST, first, wait_s=0.3)
    (refused,) = lsl.ask_peer(HOST, first, wait_s=0.3)
    assert silent.text == f"{HOST} does not answer on UDP {first} to {first + 33}"
    assert "a firewall blocks LSL" in silent.advice
    assert refused.text.endswith("lets LSL through, but no program sends a stream there")


@pytest.mark.parametrize("said", [b"LSL:shortinfo\r\nuid\r\n36014 1\r\n", b"", b"\xff\r\n<info>"])
def test_what_is_no_answer_of_a_stream_is_passed_over(said: bytes) -> None:
    """Any program may send to the port that waits for answers; a question is sent back here."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind((HOST, 0))

        def answer() -> None:
            question = other.recv(4096).split(b"\r\n")
            other.sendto(said, (HOST, int(question[2].split()[0])))

        answering = threading.Thread(target=answer)
        answering.start()
        found = lsl.ask_peer(HOST, other.getsockname()[1], wait_s=1.0)
        answering.join()
    assert all("says" not in each.text and "stream '" not in each.text for each in found)
    assert len(found) == 1


@pytest.mark.slow
def test_a_peer_that_answers_passes(outlet: pylsl.StreamOutlet) -> None:
    port = int(ElementTree.fromstring(outlet.get_info().as_xml()).findtext("v4service_port") or 0)
    found = lsl.ask_peer(HOST, port)
    one = about(found, NAME)
    assert one.verdict is Verdict.PASS
    assert "answers on UDP and on TCP" in one.text


def test_a_peer_whose_tcp_is_blocked_fails(outlet: pylsl.StreamOutlet) -> None:
    # What liblsl says of the stream, but for the port of the data, which is shut.
    info = ElementTree.fromstring(outlet.get_info().as_xml())
    with socket.socket() as shut, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as announcer:
        shut.bind((HOST, 0))
        announcer.bind((HOST, 0))
        port = shut.getsockname()[1]
        data_port = info.find("v4data_port")
        assert data_port is not None
        data_port.text = str(port)

        def announce() -> None:
            query, _ = announcer.recvfrom(4096)
            *_, back = query.decode().strip().split("\r\n")
            where, number = back.split()
            answer = f"{number}\r\n".encode() + ElementTree.tostring(info)
            announcer.sendto(answer, (HOST, int(where)))

        thread = threading.Thread(target=announce)
        thread.start()
        found = lsl.ask_peer(HOST, announcer.getsockname()[1], wait_s=0.5)
        thread.join()
    one = about(found, NAME)
    assert one.verdict is Verdict.FAIL
    assert f"is announced, but TCP {port} is not open" in one.text


def test_a_name_without_an_address_is_told() -> None:
    (found,) = lsl.ask_peer("no-such-host.invalid")
    assert found.text.startswith("no-such-host.invalid has no address")
