"""A panel on a CAN bus: frames, time-outs, unplugging, and what is no command."""

import re
import time
from contextlib import closing
from pathlib import Path

import can
import pytest
from faults.sessions import wait_for
from slcan_adapter import SlcanAdapter

from labcrane import InputDevice, Tick
from labcrane.testing import InputContract, ch8, make_frame, make_run
from labcrane_can.avc import ESTIMATED, FULL, FrameError, State, decode, encode, encode_flow
from labcrane_can.command_state import PanelCommands
from labcrane_can.panel import CanPanel
from labcrane_can.settings import CanSettings, ValveMap

RETRIEVAL = Path(__file__).parents[2] / "protocols" / "retrieval"
VALVES = {"slew": 1, "shoulder": 2, "elbow": 3, "wrist": 4}
DBC = RETRIEVAL / "avc.dbc"


def message(identifier: int, data: bytes, at: float = 0.0) -> can.Message:
    return can.Message(timestamp=at, arbitration_id=identifier, data=data)


class TestCanPanel(InputContract):  # "can"
    @pytest.fixture
    def device(self) -> InputDevice:
        return CanPanel(CanSettings(bus="virtual:contract", valves=VALVES), ch8())


@pytest.mark.parametrize(
    ("bus", "said"),
    [
        ("can0", "'can0' is not a bus; write interface:channel, as slcan:/dev/ttyACM0"),
        ("socketcand:can0@host:abc", "'abc' is not a port; write socketcand:channel@host:port"),
        ("slcam:/dev/ttyACM0", "python-can has no interface 'slcam'; did you mean 'slcan'? it has"),
        ("tty:/dev/ttyACM0", "python-can has no interface 'tty'; it has canalystii,"),
        (
            "socketcan:/dev/can0",
            "'/dev/can0' is not a network interface; write its name, as",
        ),
        ("socketcan:a_much_too_long_name", "is not a network interface"),
    ],
)
def test_a_bus_that_python_can_does_not_know_is_refused(bus: str, said: str) -> None:
    with pytest.raises(ValueError, match=re.escape(said)):
        CanSettings(bus=bus, valves=VALVES)


@pytest.mark.parametrize("interface", sorted(can.VALID_INTERFACES))
def test_every_bus_of_python_can_can_be_named(interface: str) -> None:
    assert CanSettings(bus=f"{interface}:can0", valves=VALVES).bus.startswith(interface)


def test_every_signal_survives_the_bus_with_its_sign_from_the_state() -> None:
    for signal in range(-FULL, FULL + 1):
        command = decode(*encode(5, signal, 0x25))
        assert command is not None
        assert (command.signal, command.valve, command.node, command.priority) == (signal, 5, 37, 3)


def test_the_valve_makers_example_is_read() -> None:
    command = decode(0x0CFE3506, bytes.fromhex("96FF01FFFFFFFFFF"))
    assert command is not None
    assert (command.valve, command.signal, command.state) == (5, 150, State.EXTEND)


def test_cantools_reads_what_we_send_with_the_dbc_file() -> None:
    import cantools

    database = cantools.database.load_file(DBC, frame_id_mask=0x83FFFF00)
    for signal in (-250, -1, 0, 1, 250):
        identifier, data = encode(3, signal, 0x25)
        read = database.get_message_by_frame_id(identifier).decode(data, decode_choices=False)
        assert read["AVC3_PortFlow"] == pytest.approx(0.4 * abs(signal))
        assert read["AVC3_State"] == (1 if signal > 0 else 2 if signal < 0 else 0)
    identifier, data = encode_flow(ESTIMATED, 2, -37.4, 0x80)
    read = database.get_message_by_frame_id(identifier).decode(data, decode_choices=False)
    assert (read["AVEF2_Extend"], read["AVEF2_Retract"], read["AVEF2_State"]) == (0, 37, 2)


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (b"\x10\xff\x01", "valve 1: 3 bytes instead of 8"),
        (b"\xff\xff\x01" + b"\xff" * 5, "valve 1: the port flow is not available"),
        (b"\xfe\xff\x01" + b"\xff" * 5, "valve 1: the port flow is in error"),
        (b"\xfb\xff\x01" + b"\xff" * 5, "valve 1: the port flow is reserved, 251"),
        (b"\x10\xff\x07" + b"\xff" * 5, "valve 1: the state 7 is reserved"),
        (b"\x10\xff\x0e" + b"\xff" * 5, "valve 1: the state is error"),
    ],
)
def test_malformed_commands_are_refused_and_told_when_the_panel_is_missed(
    data: bytes, why: str
) -> None:
    with pytest.raises(FrameError, match=why):
        decode(0x0CFE3125, data)
    with can.Bus(interface="virtual", channel=f"bad-{data.hex()}") as bus:
        settings = CanSettings(bus=f"virtual:bad-{data.hex()}", valves=VALVES)
        device = CanPanel(settings, ch8())
        run = make_run(ch8(), axes=device.signals)
        device.open(run)
        with closing(device):
            bus.send(message(0x0CFE3125, data))
            bus.send(message(0x18F00425, bytes(8)))
            wait_for(lambda: device._commands.refused and device._commands.foreign)
            now = time.perf_counter()
            axes = device.read(Tick(1, now, now), make_frame(run))
            assert not axes.any()
            assert device.fault == (
                f"no valve command for 0.25 s on {settings.bus}; 1 frame was refused, the last "
                f"because {why}; 1 frame was not for these valves, the last "
                "extended 0x18F00425"
            )


@pytest.mark.parametrize(
    "garbled", [b"T0CFE3\r", b"T0CFE31ZZ8000000\r", b"T0CFE31258GG\r", b"\r\x07"]
)
def test_a_garbled_line_is_refused_and_the_next_frame_obeyed(garbled: bytes) -> None:
    adapter = SlcanAdapter()
    device = CanPanel(CanSettings(bus=f"slcan:{adapter.path}", valves=VALVES), ch8())
    try:
        device.open(make_run(ch8(), axes=device.signals))
        wait_for(lambda: adapter.opened)
        for _ in range(3):
            adapter.garble(garbled)
        adapter.send(*encode(1, 100, 0x25))
        wait_for(lambda: device._commands.asked["slew"].signal == 100.0)
        assert device._listener is not None
        assert device._listener.lost is None
        if garbled.startswith(b"T"):
            assert device._commands.refused == 3
            assert device._commands.why.startswith("the adapter's line is not a frame (")
    finally:
        device.close()
        adapter.unplug()


def test_float_block_and_old_commands_ask_for_no_flow() -> None:
    commands = PanelCommands(ValveMap(valves=VALVES))
    commands.take(message(*encode(1, 120, 0x25)), 0.0)
    commands.take(message(*encode(2, 0, 0x25, state=State.FLOAT)), 0.2)
    assert commands.signals(0.25) == ([120.0, 0, 0, 0], [False, True, False, False], True)
    assert commands.signals(0.26) == ([0.0, 0, 0, 0], [False, True, False, False], True)
    assert commands.signals(0.46) == ([0.0, 0, 0, 0], [False] * 4, False)


def test_a_single_open_valve_that_falls_silent_holds_the_machine_and_is_named() -> None:
    device = CanPanel(CanSettings(bus="virtual:silent", valves=VALVES), ch8())
    run = make_run(ch8(), axes=device.signals)

    def read(now: float, levels: dict[str, int]) -> tuple[list[float], str | None]:
        """Let commands come, and read the panel at the same moment, in s."""
        for joint, level in levels.items():
            device._commands.take(message(*encode(VALVES[joint], level, 0x25)), now)
        return device.read(Tick(1, now, now), make_frame(run))[:4].tolist(), device.fault

    device.open(run)
    with closing(device):
        levels = {"slew": 0, "shoulder": 125, "elbow": -50}
        assert read(100.0, levels) == ([0.0, 0.5, -0.2, 0.0], None)
        # Nothing came since; the wrist has never been heard, and may be silent.
        axes, why = read(100.3, {"slew": 25, "elbow": -50})
        assert axes == [0.0] * 4
        assert why == (
            "no command for 0.25 s to a valve that was open: shoulder at 125; see what the "
            "panel sends, or move that lever again"
        )
        again = read(100.31, {"shoulder": 0, "slew": 25, "elbow": 0})
        assert again == ([0.1, 0.0, 0.0, 0.0], None)
        # Others are shut: their silence does no harm.
        assert read(100.7, {"slew": 25}) == ([0.1, 0.0, 0.0, 0.0], None)


def test_another_node_or_priority_is_foreign_when_the_protocol_names_them() -> None:
    commands = PanelCommands(ValveMap(valves=VALVES, node=0x25, priority=3))
    commands.take(message(*encode(1, 120, 0x26)), 0.0)
    commands.take(message(*encode(1, 120, 0x25, priority=6)), 0.0)
    assert commands.foreign == 2
    commands.take(message(*encode(1, 120, 0x25)), 0.0)
    assert commands.signals(0.0)[0][0] == 120.0


def test_a_flooded_bus_holds_the_machine_and_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("labcrane_can.listener.MOST_FRAMES_S", 300)
    settings = CanSettings(bus="virtual:flood", valves=VALVES)
    device = CanPanel(settings, ch8())
    run = make_run(ch8(), axes=device.signals)
    with can.Bus(interface="virtual", channel="flood") as bus:
        device.open(run)
        with closing(device):
            end = time.perf_counter() + 240.0
            while time.perf_counter() < end and "flooded" not in (device.fault or ""):
                for _ in range(100):  # however seldom this process has its turn
                    bus.send(message(*encode(1, 100, 0x25)))
                time.sleep(0.002)
                now = time.perf_counter()
                axes = device.read(Tick(1, now, now), make_frame(run))
            assert "virtual:flood is flooded:" in (device.fault or "")
            assert "where 300 are the most" in (device.fault or "")
            assert not axes.any()
