"""Panels whose messages a DBC file describes."""

import random
import shutil
from pathlib import Path

import can
import pytest
from rehearsal import loaded
from wrong_protocols import PROTOCOLS

from labcrane import ProtocolError
from labcrane.testing import ch8
from labcrane_can.command_state import PanelCommands
from labcrane_can.settings import ValveMap

LEVERS = (
    'VERSION ""\nNS_ :\nBS_:\nBU_: P\n\nBO_ 256 Levers: 4 P\n'
    ' SG_ Boom : 0|16@1- (0.1,0) [-100|100] "%" P\n'
    ' SG_ Arm : 16|16@1- (0.1,0) [-100|100] "%" P\n'
)


@pytest.fixture
def panel(tmp_path: Path) -> Path:
    (tmp_path / "panel.dbc").write_text(LEVERS, encoding="utf-8")
    return tmp_path / "panel.dbc"


def test_a_dbc_file_maps_another_panel(panel: Path) -> None:
    settings = ValveMap(valves={"elbow": "Levers.Boom", "shoulder": "Levers.Arm"}, map=panel)
    commands = PanelCommands(settings)
    frame = can.Message(
        arbitration_id=256,
        is_extended_id=False,
        data=(500).to_bytes(2, "little") + (-1000).to_bytes(2, "little", signed=True),
    )
    commands.take(frame, 0.0)
    assert commands.signals(0.0)[0] == [125.0, -250.0]
    with pytest.raises(
        ProtocolError, match=r"has no 'Levers.Bom' for joint 'elbow'; it has Levers"
    ):
        PanelCommands(ValveMap(valves={"elbow": "Levers.Bom"}, map=panel))


PAGES = (
    'VERSION ""\nNS_ :\nBS_:\nBU_: P\n\nBO_ 256 Levers: 8 P\n'
    ' SG_ Page M : 0|8@1+ (1,0) [0|255] "" P\n'
    ' SG_ Boom m0 : 8|16@1- (0.1,0) [-100|100] "%" P\n'
    ' SG_ Heat m1 : 8|8@1- (1,0) [-40|120] "degC" P\n'
)


def test_a_page_that_the_dbc_does_not_list_is_refused_and_the_panel_stays(tmp_path: Path) -> None:
    (tmp_path / "pages.dbc").write_text(PAGES, encoding="utf-8")
    commands = PanelCommands(ValveMap(valves={"elbow": "Levers.Boom"}, map=tmp_path / "pages.dbc"))
    known = bytes([0]) + (500).to_bytes(2, "little") + bytes(5)
    for number in range(256):
        page = bytes([number]) + known[1:]
        commands.take(can.Message(arbitration_id=256, is_extended_id=False, data=page), 0.0)
    assert commands.refused == 254
    assert "Levers cannot be decoded: expected multiplexer id 0 or 1, but got 255" in commands.why
    assert commands.signals(0.0)[0] == [125.0]


def test_any_eight_bytes_are_obeyed_or_refused(tmp_path: Path) -> None:
    (tmp_path / "pages.dbc").write_text(PAGES, encoding="utf-8")
    commands = PanelCommands(ValveMap(valves={"elbow": "Levers.Boom"}, map=tmp_path / "pages.dbc"))
    drawn = random.Random(11)
    for _ in range(2_000):
        data = drawn.randbytes(drawn.randrange(0, 9))
        commands.take(can.Message(arbitration_id=256, is_extended_id=False, data=data), 0.0)
    assert 1_900 < commands.refused < 2_000


@pytest.mark.parametrize(
    ("valves", "wrong", "said"),
    [
        (
            "{base: Levers.Bom, arm: Levers.Arm}, map: panel.dbc",
            "Levers.Bom,",
            "input.valves.base is 'Levers.Bom', and there is no such signal of the map; did you "
            "mean 'Levers.Boom'? it has Levers.Arm, Levers.Boom",
        ),
        (
            "{base: Levers.Arm, arm: Levers.Arm}, map: panel.dbc",
            "Levers.Arm}",
            "input.valves has 'Levers.Arm' for both 'base' and 'arm'; give each its own",
        ),
        ("{base: 3, arm: 3}", "3}", "input.valves has '3' for both 'base' and 'arm'; give each"),
        ("{base: Levers.Boom}, map: protocol.yaml", "{use: can", "map "),
    ],
)
def test_a_check_looks_into_the_dbc_file(panel: Path, valves: str, wrong: str, said: str) -> None:
    shutil.copytree(PROTOCOLS / "retrieval", panel.parent, dirs_exist_ok=True)
    path = panel.parent / "protocol.yaml"
    text = path.read_text(encoding="utf-8")
    text = text.replace("{base: 1, arm: 2, boom: 3, jaws: 4}", valves)
    path.write_text(text, encoding="utf-8")
    line = text[: text.index("input:")].count("\n") + 1
    column = text.splitlines()[line - 1].index(wrong) + 1
    with pytest.raises(ProtocolError) as told:
        loaded(path)
    found = [each for each in str(told.value).splitlines() if f"{line}:{column}: {said}" in each]
    assert len(found) == 1, str(told.value)


def levers(path: Path, text: str, encoding: str = "utf-8", **settings: float) -> PanelCommands:
    path.write_text(text, encoding=encoding)
    return PanelCommands(ValveMap(valves={"elbow": "Levers.Boom"}, map=path, **settings))


UNSIGNED = LEVERS.replace("16@1-", "16@1+").replace("[-100|100]", "[0|100]")


@pytest.mark.parametrize("seed", range(5))
def test_a_lever_that_rests_in_the_middle_of_its_range_asks_for_nothing_there(
    tmp_path: Path, seed: int
) -> None:
    drawn = random.Random(seed)
    neutral, full = drawn.uniform(10.0, 90.0), 100.0
    commands = levers(tmp_path / "uni.dbc", UNSIGNED, neutral=neutral, full=full)
    for _ in range(200):
        raw = drawn.randrange(0, 1001)
        share = (raw / 10 - neutral) / (full - neutral)
        before = commands.refused
        data = raw.to_bytes(2, "little") + bytes(2)
        commands.take(can.Message(arbitration_id=256, is_extended_id=False, data=data), 0.0)
        if abs(share) <= 1.0:
            assert commands.signals(0.0)[0] == [pytest.approx(250 * share, abs=0.5 + 1e-9)]
        assert commands.refused - before == (abs(share) > 1.0)


@pytest.mark.parametrize("given", [{}, {"neutral": 0.0}, {"neutral": 100.0, "full": 200.0}])
def test_a_signal_on_one_side_of_rest_is_refused_with_both_keys(
    tmp_path: Path, given: dict[str, float]
) -> None:
    rest = given.get("neutral", 0)
    with pytest.raises(ProtocolError) as told:
        levers(tmp_path / "uni.dbc", UNSIGNED, **given)
    assert str(told.value) == (
        f"Levers.Boom is 0 to 100 in {tmp_path / 'uni.dbc'}, never on both sides of neutral, which "
        f"is {rest:g}. Where it rests between its ends, give its values at rest and at full flow, "
        "neutral and full, as the panel's manual has them. Where it has no sign, name the signals "
        "of its sides: {value: Levers.Boom, positive: Message.Signal, negative: Message.Signal}"
    )


def test_full_flow_is_above_rest() -> None:
    with pytest.raises(ValueError, match="full is 100 and neutral 100; full flow is a greater"):
        ValveMap(valves={"elbow": 1}, neutral=100.0)


@pytest.mark.parametrize(
    ("full", "asked"),
    [
        (100.0, None),
        (50.0, "goes from -100 to 100: what is beyond -50 to 50 is refused"),
        (250.0, "goes from -100 to 100, so that the valve is never fully open"),
    ],
)
def test_a_full_flow_that_the_lever_misses_is_asked_about(
    panel: Path, full: float, asked: str | None
) -> None:
    settings = ValveMap(valves={"elbow": "Levers.Boom"}, map=panel, full=full)
    found = settings.doubts(ch8())
    assert found == ({} if asked is None else {"full": f"is {full:g}, and Levers.Boom {asked}"})


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "cp1250", "gb18030", "cp1252"])
def test_comments_may_be_in_any_language(tmp_path: Path, encoding: str) -> None:
    comment = {"gb18030": "起重机", "cp1252": "Drehsäule"}.get(encoding, "Łyżka ťž")
    text = LEVERS + f'CM_ SG_ 256 Boom "{comment}";\n'
    commands = levers(tmp_path / "panel.dbc", text, encoding)
    data = (500).to_bytes(2, "little") + bytes(2)
    commands.take(can.Message(arbitration_id=256, is_extended_id=False, data=data), 0.0)
    assert commands.signals(0.0)[0] == [125.0]


OVERLAP = (
    'BO_ 512 Other: 8 P\n SG_ A : 0|8@1- (1,0) [-100|100] "" P\n'
    ' SG_ B : 4|8@1- (1,0) [-100|100] "" P\n'
)


def test_signals_that_overlap_are_refused_where_they_are_used_and_nowhere_else(
    tmp_path: Path,
) -> None:
    text = LEVERS + "\n" + OVERLAP
    assert levers(tmp_path / "panel.dbc", text).asked
    with pytest.raises(ProtocolError, match=r"cannot be used for joint 'elbow': .*overlapping"):
        PanelCommands(ValveMap(valves={"elbow": "Other.A"}, map=tmp_path / "panel.dbc"))


def test_an_extended_frame_is_another_than_the_standard_one_of_its_number(panel: Path) -> None:
    commands = PanelCommands(ValveMap(valves={"elbow": "Levers.Boom"}, map=panel))
    data = (500).to_bytes(2, "little") + bytes(2)
    commands.take(can.Message(arbitration_id=256, is_extended_id=True, data=data), 0.0)
    assert commands.signals(0.0) == ([0.0], [False], False)
    assert commands.complaint() == (
        "1 frame was not for these valves, the last extended 0x00000100"
    )


J1939 = LEVERS.replace("BO_ 256 Levers: 4 P", f"BO_ {0x8CFDD6FE} Levers: 8 P")


def test_a_j1939_panel_has_any_source_and_priority(tmp_path: Path) -> None:
    drawn = random.Random(3)
    text = J1939
    data = (500).to_bytes(2, "little") + bytes(6)
    for _ in range(50):
        node, priority = drawn.randrange(254), drawn.randrange(8)
        identifier = priority << 26 | 0xFDD6 << 8 | node
        commands = levers(tmp_path / "j1939.dbc", text)
        commands.take(can.Message(arbitration_id=identifier, data=data), 0.0)
        assert commands.signals(0.0)[0] == [125.0]
        commands = levers(tmp_path / "j1939.dbc", text)
        commands.take(can.Message(arbitration_id=identifier + 0x100, data=data), 0.0)
        assert not commands.signals(0.0)[2]
        assert f"the last extended 0x{identifier + 0x100:08X}" in commands.complaint()
    commands = levers(tmp_path / "j1939.dbc", text, node=0x27)
    commands.take(can.Message(arbitration_id=0x0CFDD628, data=data), 0.0)
    assert not commands.signals(0.0)[2]
    commands.take(can.Message(arbitration_id=0x0CFDD627, data=data), 0.0)
    assert commands.signals(0.0)[2]


@pytest.mark.parametrize("seed", range(4))
def test_a_lever_without_a_stated_range_that_rests_between_its_ends_is_refused(
    tmp_path: Path, seed: int
) -> None:
    """Editors write [0|0]: a lever that rests at 128 gave half flow at rest, without a word."""
    drawn = random.Random(seed)
    length, scale = drawn.randrange(8, 17), drawn.choice([0.1, 0.4, 1.0])
    signal = f' SG_ Boom : 0|{length}@1+ ({scale},0) [0|0] "%" P'
    text = "\n".join([*LEVERS.splitlines()[:6], signal, ""])
    most = scale * (2**length - 1)
    with pytest.raises(ProtocolError, match=rf"Levers.Boom is 0 to {most:g} in .*, never on both"):
        levers(tmp_path / "none.dbc", text)
    assert levers(tmp_path / "none.dbc", text.replace("@1+", "@1-")).asked


def bjm(position: float, right: int, left: int) -> bytes:
    """Return a frame of a J1939 basic joystick: two states of two bits, position in 0.1 %."""
    bits = left << 2 | right << 4 | round(position * 10) << 6
    return bits.to_bytes(2, "little") + bytes([0xFF] * 6)


JOYSTICK = (
    'VERSION ""\nNS_ :\nBS_:\nBU_: J\n\nBO_ 2365445886 BJM1: 8 J\n'
    ' SG_ XLeft : 2|2@1+ (1,0) [0|3] "" J\n SG_ XRight : 4|2@1+ (1,0) [0|3] "" J\n'
    ' SG_ X : 6|10@1+ (0.1,0) [0|100] "%" J\n'
)
SIDED = {"value": "BJM1.X", "positive": "BJM1.XRight", "negative": "BJM1.XLeft"}


def test_a_standard_joystick_moves_a_joint_to_the_side_that_it_is_moved_to(tmp_path: Path) -> None:
    """Its position is a magnitude: the remedy "neutral: 50" drove each joint at full speed."""
    (tmp_path / "bjm.dbc").write_text(JOYSTICK, encoding="utf-8")
    with pytest.raises(ProtocolError, match="Where it has no sign, name the signals of its sides"):
        PanelCommands(ValveMap(valves={"elbow": "BJM1.X"}, map=tmp_path / "bjm.dbc"))
    commands = PanelCommands(ValveMap(valves={"elbow": SIDED}, map=tmp_path / "bjm.dbc"))
    drawn = random.Random(7)
    for number in range(2000):
        position, side = drawn.uniform(0.0, 102.3), drawn.choice([(0, 0), (1, 0), (0, 1)])
        if number % 3 == 0:
            side = drawn.choice([(1, 1), (2, 0), (0, 2), (3, 3)])
        frame = can.Message(arbitration_id=0x0CFDD6FE, data=bjm(position, *side))
        before, was = commands.refused, commands.signals(0.0)[0]
        commands.take(frame, 0.0)
        now, (right, left) = commands.signals(0.0)[0], side
        if number % 3 == 0:
            assert now == [0.0]
            assert commands.refused == before + 1
            assert "BJM1.X" in (commands.silent(0.0) or "")
        elif round(position * 10) > 1000:
            assert now == was
            assert commands.refused == before + 1
        else:
            assert now == [pytest.approx(2.5 * position * (right - left), abs=0.7)]


def test_the_sides_of_a_lever_are_in_its_message(tmp_path: Path) -> None:
    other = 'BO_ 256 Other: 1 J\n SG_ Side : 0|2@1+ (1,0) [0|3] "" J\n'
    (tmp_path / "two.dbc").write_text(JOYSTICK + "\n" + other, encoding="utf-8")
    valves = {"elbow": SIDED | {"negative": "Other.Side"}}
    with pytest.raises(ProtocolError, match="and a side in Other; all of them must be in one"):
        PanelCommands(ValveMap(valves=valves, map=tmp_path / "two.dbc"))


def test_a_study_checks_the_signals_of_a_standard_joystick(panel: Path) -> None:
    panel.write_text(JOYSTICK, encoding="utf-8")
    shutil.copytree(PROTOCOLS / "retrieval", panel.parent, dirs_exist_ok=True)
    path = panel.parent / "protocol.yaml"
    text = path.read_text(encoding="utf-8")
    written = "{value: BJM1.X, positive: BJM1.XRight, negative: BJM1.XLeft}"
    valves = f"{{base: {written}}}, map: panel.dbc"
    text = text.replace("{base: 1, arm: 2, boom: 3, jaws: 4}", valves)
    text = text.replace("scheme: {use: valve,", "scheme: {use: valve, map: MAP,")
    rest = "{arm: panel.connected, boom: float.base, jaws: panel.connected}"
    path.write_text(text.replace("map: MAP", f"map: {rest}"), encoding="utf-8")
    with pytest.raises(ProtocolError) as told:
        loaded(path)
    assert "BJM1" not in str(told.value)
    path.write_text(path.read_text("utf-8").replace("BJM1.XLeft", "BJM1.XLft"), encoding="utf-8")
    with pytest.raises(ProtocolError, match=r"BJM1\.XLft.*did you mean 'BJM1.XLeft'"):
        loaded(path)
