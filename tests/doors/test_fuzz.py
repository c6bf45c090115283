"""Ten thousand broken inputs at the doors: taken, or refused by a documented error, in time."""

import json
import struct
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import can
import numpy as np
import pytest
from doors.fuzz import MOST_S, Door, attack
from doors.test_signals import FLOATS, VALVES, Newest
from rehearsal import SHORT, a_study

from labcrane import LabcraneError
from labcrane.core import AnswerError
from labcrane.files.yaml import parse_yaml
from labcrane.limits import LIMITS, LimitError
from labcrane.machines import MeshError, read_surface
from labcrane.recording import StreamHeader
from labcrane.recording.xdf.reader import read_xdf
from labcrane.session.commands import (
    MessageError,
    SettingChange,
    beyond_limits,
    decode,
    read_request,
)
from labcrane.session.commands import encode as encode_message
from labcrane.session.live_settings import FeedbackSettings
from labcrane.session.questionnaire import QuestionnaireForm
from labcrane.testing import Command, Order, Study, ch8
from labcrane_bids.dataset import people_table
from labcrane_can.command_state import PanelCommands
from labcrane_can.dbc import every_signal
from labcrane_can.settings import ValveMap
from labcrane_dmd.fit.recordings import read_recordings
from labcrane_gateway.settings import GatewaySettings
from labcrane_gateway.station import Station
from labcrane_keyboard.keyboard import Keyboard
from labcrane_keyboard.settings import KeyboardSettings

SPHERE = "feedback:\n  ball: {use: sphere}\n"


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Study:
    text = SHORT.replace(
        "      - block", "      - questionnaire: subjective_accuracy\n      - block"
    )
    return a_study(tmp_path_factory.mktemp("study"), text + SPHERE)


def text_of(given: bytes) -> str:
    """Return bytes as a page's text: half characters and all."""
    return given.decode("utf-8", "surrogateescape")


def words(order: Order) -> Callable[[Study, Path], Callable[[bytes], object]]:
    def door(study: Study, folder: Path) -> Callable[[bytes], object]:
        def enter(given: bytes) -> None:
            command = Command(order, text_of(given), "participant")
            read_request(command)
            if beyond_limits(command) is None:
                assert decode(encode_message(command)) == command, "it comes out as it went in"

        return enter

    return door


def answers(study: Study, folder: Path) -> Callable[[bytes], object]:
    """One questionnaire takes everything; only what it accepts may become an answer."""
    form = QuestionnaireForm("subjective_accuracy", study.questionnaires["subjective_accuracy"], {})

    def enter(given: bytes) -> None:
        name, data = form.take(text_of(given), "participant")
        json.dumps(data).encode()
        if name == "questionnaire.answer":
            assert data["value"] is None or 0.0 <= data["value"] <= 10.0
        else:
            assert name == "questionnaire.refused"
            assert len(data["given"]) <= LIMITS["answer"].most

    return enter


def settings(study: Study, folder: Path) -> Callable[[bytes], object]:
    live = FeedbackSettings(study.cues)

    def enter(given: bytes) -> None:
        command = Command(Order.SETTING, text_of(given), "supervisor")
        asked = read_request(command)
        if beyond_limits(command) is None and isinstance(asked, SettingChange):
            why = live.refusal(asked)
            if why is None:
                assert live.change(asked)["key"] in type(study.cues["ball"].settings).model_fields

    return enter


def messages(study: Study, folder: Path) -> Callable[[bytes], object]:
    return decode


def frames(study: Study, folder: Path) -> Callable[[bytes], object]:
    path = folder / "floats.dbc"
    path.write_text(FLOATS)
    chosen = (ValveMap(valves=VALVES, map=path), ValveMap(valves={"elbow": 1, "shoulder": 2}))
    panels = [PanelCommands(each) for each in chosen]

    def enter(given: bytes) -> None:
        head, data = given[:4].ljust(4, b"\0"), given[4:12]
        (identifier,) = struct.unpack("<I", head)
        extended = bool(identifier >> 31)
        most = 0x1FFFFFFF if extended else 0x7FF
        frame = can.Message(
            arbitration_id=identifier & most, is_extended_id=extended, data=data, check=True
        )
        for panel in panels:
            panel.take(frame, 0.0)
            assert all(abs(signal) <= 250.0 for signal in panel.signals(0.0)[0])

    return enter


def floats(given: bytes, count: int) -> list[float]:
    return list(struct.unpack(f"<{count}d", given[: 8 * count].ljust(8 * count, b"\0")))


def stations(study: Study, folder: Path) -> Callable[[bytes], object]:
    machine = ch8()

    def enter(given: bytes) -> None:
        station = Station(GatewaySettings(), machine)
        station._station, station._order = Newest(floats(given, 4)), [0, 1, 2, 3]
        station._pull(1.0)
        assert all(abs(signal) <= 250.0 for signal in station._signals)

    return enter


def keys(study: Study, folder: Path) -> Callable[[bytes], object]:
    def enter(given: bytes) -> None:
        keyboard = Keyboard(KeyboardSettings(view="main", axes={"slew": ("a", "d")}))
        keyboard._keys, keyboard._pairs, keyboard._seen = Newest(floats(given, 2)), [(0, 1)], True
        keyboard._pull(1.0)
        assert all(abs(wanted) <= 1.0 for wanted in keyboard._wanted)

    return enter


def headers(study: Study, folder: Path) -> Callable[[bytes], object]:
    def enter(given: bytes) -> None:
        header = StreamHeader.from_xml(given.decode("utf-8", "replace"))
        assert 1 <= len(header.channels) <= LIMITS["stream channels"].most
        assert np.isfinite(header.rate_hz)
        assert header.host is not None

    return enter


def file(name: str, read: Callable[[Path], object]) -> Callable[..., Callable[[bytes], object]]:
    def door(study: Study, folder: Path) -> Callable[[bytes], object]:
        path = folder / name

        def enter(given: bytes) -> None:
            path.write_bytes(given)
            try:
                read(path)
            except (LabcraneError, MeshError) as error:
                if str(path) not in str(error):
                    raise AssertionError("it does not say which file") from error
                raise

        return enter

    return door


def yaml(study: Study, folder: Path) -> Callable[[bytes], object]:
    return lambda given: parse_yaml(given.decode("utf-8", "replace"), "the file")


DOORS = {
    "answer": (answers, 1500, ()),
    "note": (words(Order.NOTE), 400, ()),
    "hint": (words(Order.HINT), 300, ()),
    "order": (words(Order.COMPLETION), 300, ()),
    "report": (words(Order.REPORT), 300, (b"deformity",)),
    "setting": (settings, 500, (b"ball.far=", b"=", b".", b"&a", b"*a", b"!!int")),
    "message": (messages, 700, (b'"kind"', b'"order"', b"true", b"null")),
    "can": (frames, 1400, ()),
    "gateway": (stations, 600, ()),
    "keys": (keys, 400, ()),
    "header": (headers, 1500, (b"<!DOCTYPE a>", b"<desc>", b"</info>", b"&#0;", b"&lt;", b"inf")),
    "samples": (file("foreign.xdf", read_xdf), 800, (b"\x08", b"\x04", b"\x03\x00")),
    "yaml": (yaml, 500, (b"&a ", b"*a", b"<<: ", b"!!python/name:os", b"- - - ", b"? ", b"|\n")),
    "dbc": (file("panel.dbc", every_signal), 150, (b"SG_", b"BO_ ", b"@1-", b"m0", b"M")),
    "people": (file("people.csv", people_table), 800, (b"\x1f\x8b", b"\t", b";", b'""')),
    "stl": (file("a.stl", read_surface), 300, (b"vertex", b"endfacet", b"solid", b"inf")),
    "obj": (file("a.obj", read_surface), 400, (b"\nf ", b"\nv ", b"/", b"\\\n", b"-1", b"inf")),
    "recordings": (file("boom.csv", read_recordings), 200, (b"\x1f\x8b", b"inf", b"250", b'"')),
}  # fmt: skip
REFUSALS = (LabcraneError, MeshError, AnswerError, LimitError, MessageError)
GATE, ONCE = 10_000, 200_000


def door_of(name: str, study: Study, folder: Path) -> Door:
    make, cheap, means = DOORS[name]
    return Door(name, make(study, folder), REFUSALS, cheap, means)


@pytest.mark.slow
@pytest.mark.parametrize("name", DOORS)
def test_what_is_broken_is_taken_or_refused_by_a_documented_error(
    name: str, study: Study, tmp_path: Path
) -> None:
    door = door_of(name, study, tmp_path)
    door.enter(door.good()[0])  # libraries are loaded once
    for kept in door.good():  # among them what once broke the door
        with suppress(*REFUSALS):
            door.enter(kept)
    found = attack(door, door.cheap, seed=15)
    assert sum(found.values()) == door.cheap


@pytest.mark.soak
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("name", DOORS)
def test_two_hundred_thousand_broken_inputs(name: str, study: Study, tmp_path: Path) -> None:
    door = door_of(name, study, tmp_path)
    door.enter(door.good()[0])
    attack(door, ONCE // GATE * door.cheap, 1500, MOST_S)


def test_ten_thousand_inputs_are_tried_in_the_gate() -> None:
    assert sum(cheap for _, cheap, _ in DOORS.values()) >= GATE
