"""What panels, stations and views send is finite and within its range, or the input is lost."""

import math
import random
import struct
from collections.abc import Sequence
from pathlib import Path

import can
import pytest
from faults.sessions import wait_for
from hypothesis import given, settings
from hypothesis import strategies as st

from labcrane import ProtocolError
from labcrane.testing import ch8
from labcrane_can.command_state import PanelCommands
from labcrane_can.dbc import every_signal
from labcrane_can.listener import Listener
from labcrane_can.settings import CanSettings, ValveMap
from labcrane_gateway.settings import GatewaySettings
from labcrane_gateway.station import Station
from labcrane_keyboard.keyboard import Keyboard
from labcrane_keyboard.settings import KeyboardSettings

FLOATS = (
    'VERSION ""\nNS_ :\nBS_:\nBU_: P\n\nBO_ 256 Levers: 8 P\n'
    ' SG_ Boom : 0|32@1- (1,0) [-100|100] "%" P\n'
    ' SG_ Arm : 32|32@1- (1,0) [-100|100] "%" P\n\n'
    "SIG_VALTYPE_ 256 Boom : 1;\nSIG_VALTYPE_ 256 Arm : 1;\n"
)
VALVES = {"elbow": "Levers.Boom", "shoulder": "Levers.Arm"}


@pytest.fixture(scope="module")
def panel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("dbc") / "floats.dbc"
    path.write_text(FLOATS)
    return path


def levers(*values: float) -> can.Message:
    data = struct.pack("<2f", *values)
    return can.Message(arbitration_id=256, is_extended_id=False, data=data)


@pytest.mark.parametrize("broken", [math.nan, math.inf, -math.inf])
def test_a_lever_that_is_no_number_shuts_its_valve_at_once_and_is_named(
    panel: Path, broken: float
) -> None:
    commands = PanelCommands(ValveMap(valves=VALVES, map=panel))
    commands.take(levers(50.0, -20.0), 0.0)
    assert commands.signals(0.0)[0] == [125.0, -50.0]
    commands.take(levers(broken, -20.0), 0.01)
    assert commands.signals(0.01)[0] == [0.0, -50.0]
    assert commands.silent(0.01) == (
        f"Levers.Boom is {broken}, which is not a number; check the panel"
    )
    commands.take(levers(40.0, -20.0), 0.02)
    assert commands.silent(0.02) is None
    assert commands.signals(0.02)[0] == [100.0, -50.0]


@pytest.mark.slow
@settings(max_examples=1500, deadline=None)
@given(
    st.binary(max_size=8), st.integers(0, 2**29 - 1) | st.just(256), st.sampled_from([(), VALVES])
)
def test_whatever_a_frame_holds_the_signals_stay_within_full_flow(
    panel: Path, data: bytes, identifier: int, described: object
) -> None:
    known = VALVES if described else {"elbow": 1, "shoulder": 2}
    commands = PanelCommands(ValveMap(valves=known, map=panel if described else None))
    extended = identifier != 256 if described else True
    commands.take(can.Message(arbitration_id=identifier, is_extended_id=extended, data=data), 0.0)
    assert all(abs(signal) <= 250.0 for signal in commands.signals(0.0)[0])


def test_the_thread_that_reads_a_bus_survives_what_is_no_number_and_what_raises(
    panel: Path, monkeypatch
) -> None:
    chosen = CanSettings(bus="virtual:floats", valves=VALVES, map=panel)
    commands = PanelCommands(chosen)
    listener = Listener(chosen, commands)
    sender = can.Bus(interface="virtual", channel="floats")
    try:
        sender.send(levers(math.nan, 0.0))
        wait_for(lambda: commands.refused == 1)
        sender.send(levers(30.0, 0.0))
        wait_for(lambda: commands.asked["elbow"].signal == 75.0)

        def broken(frame: object, now: float) -> None:
            monkeypatch.undo()
            raise ZeroDivisionError("nobody has thought of this")

        monkeypatch.setattr(commands, "take", broken)
        sender.send(levers(30.0, 0.0))
        wait_for(lambda: "nobody has thought of this" in str(listener.lost))
        wait_for(lambda: listener.lost is None)
        sender.send(levers(10.0, 0.0))
        wait_for(lambda: commands.asked["elbow"].signal == 25.0)
    finally:
        listener.close()
        sender.shutdown()


def test_a_damaged_dbc_file_is_refused_in_words(tmp_path: Path) -> None:
    dice = random.Random(15)
    path = tmp_path / "damaged.dbc"
    for _ in range(300):
        text = bytearray(FLOATS.encode())
        for _ in range(dice.randint(1, 8)):
            text[dice.randrange(len(text))] = dice.randrange(256)
        path.write_bytes(text)
        try:
            every_signal(path)
        except ProtocolError as error:
            assert str(path) in str(error)  # noqa: PT017 - most damage is harmless
    path.write_bytes(b" " * 1_000_001)
    with pytest.raises(ProtocolError, match="it has 1000001 bytes; the most are 1000000"):
        every_signal(path)


class Newest:
    """Gives one sample again and again."""

    complaint = ""
    connected = True

    def __init__(self, sample: Sequence[float]) -> None:
        self._sample = sample

    def newest(self) -> Sequence[float]:
        return self._sample


@settings(max_examples=300)
@given(st.lists(st.floats(width=32), min_size=4, max_size=4))
def test_a_stations_sample_is_within_full_flow_or_refused(sample: list[float]) -> None:
    station = Station(GatewaySettings(), ch8())
    station._station, station._order = Newest(sample), [0, 1, 2, 3]
    station._pull(1.0)
    fits = all(abs(value) <= 250.0 for value in sample)
    assert station._came == (1.0 if fits else -math.inf)
    assert all(abs(signal) <= 250.0 for signal in station._signals)


@settings(max_examples=300)
@given(st.lists(st.sampled_from([0.0, 1.0]) | st.floats(), min_size=2, max_size=2))
def test_a_key_is_up_or_down_or_refused(sample: list[float]) -> None:
    keyboard = Keyboard(KeyboardSettings(view="main", axes={"slew": ("a", "d")}))
    keyboard._keys, keyboard._pairs = Newest(sample), [(0, 1)]
    keyboard._seen = True
    keyboard._pull(1.0)
    fits = all(0.0 <= value <= 1.0 for value in sample)
    assert keyboard._came == (1.0 if fits else -math.inf)
    assert all(abs(wanted) <= 1.0 for wanted in keyboard._wanted)
