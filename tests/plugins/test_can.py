"""A panel on a CAN bus: frames, time-outs, unplugging, replay, and what is no command."""

import random
import re
import time
from pathlib import Path

import can
import numpy as np
import pytest
from slcan_adapter import SlcanAdapter

from labcrane import InputDevice, ProtocolError, Tick
from labcrane.testing import InputContract, ch8, make_frame, make_run
from labcrane.testing.commands import CommandContract
from labcrane_can import labcrane_commands
from labcrane_can.avc import ESTIMATED, FULL, FrameError, State, decode, encode, encode_flow
from labcrane_can.command_state import PanelCommands
from labcrane_can.panel import CanPanel
from labcrane_can.replay import CanReplay
from labcrane_can.settings import CanSettings, ReplaySettings, ValveMap

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


class TestCommands(CommandContract):
    @pytest.fixture(params=labcrane_commands(), ids=lambda offered: " ".join(offered.words))
    def command(self, request):
        return request.param


class TestCanReplay(InputContract):  # "can_replay"
    goes_on = True

    @pytest.fixture
    def device(self, tmp_path: Path) -> InputDevice:
        return CanReplay(ReplaySettings(file=a_log(tmp_path / "a.log"), valves=VALVES), ch8())


def a_log(path: Path, seed: int = 2) -> Path:
    random = np.random.default_rng(seed)
    with can.Logger(path) as log:
        for number in range(400):
            level = int(random.integers(-250, 251))
            # Times that every format can hold, and that do not fall on ticks.
            log(message(*encode(1 + number % 4, level, 0x25), at=1000.0 + 0.0101 * number))
    return path


def commands_of(device: InputDevice, ticks: int) -> bytes:
    run = make_run(ch8(), axes=device.signals)
    device.open(run)
    frame = make_frame(run)
    read = [device.read(Tick(number, 0.0, 0.0), frame).tobytes() for number in range(ticks)]
    device.close()
    return b"".join(read)


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
        try:
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
        finally:
            device.close()


def wait_for(ready, seconds: float = 240.0) -> None:
    end = time.perf_counter() + seconds
    while not ready():
        assert time.perf_counter() < end, "waited in vain"
        time.sleep(0.005)


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
    try:
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
    finally:
        device.close()


def test_another_node_or_priority_is_foreign_when_the_protocol_names_them() -> None:
    commands = PanelCommands(ValveMap(valves=VALVES, node=0x25, priority=3))
    commands.take(message(*encode(1, 120, 0x26)), 0.0)
    commands.take(message(*encode(1, 120, 0x25, priority=6)), 0.0)
    assert commands.foreign == 2
    commands.take(message(*encode(1, 120, 0x25)), 0.0)
    assert commands.signals(0.0)[0][0] == 120.0


def test_the_same_log_gives_the_same_commands_bit_for_bit_in_every_format(tmp_path: Path) -> None:
    first = None
    for ending in ("log", "asc", "blf"):
        path = a_log(tmp_path / f"panel.{ending}")
        settings = ReplaySettings(file=path, valves=VALVES)
        for _ in range(2):
            got = commands_of(CanReplay(settings, ch8()), 1200)
            assert first is None or got == first, ending
            first = got


def test_a_candump_log_of_a_live_bus_replays_what_the_panel_was_heard_to_say(
    tmp_path: Path,
) -> None:
    path = a_log(tmp_path / "live.log")
    live = PanelCommands(ValveMap(valves=VALVES))
    frames = list(can.LogReader(path))
    device = CanReplay(ReplaySettings(file=path, valves=VALVES), ch8())
    run = make_run(ch8(), axes=device.signals)
    device.open(run)
    waiting, start = list(frames), frames[0].timestamp
    for number in range(900):
        now = number / run.rate_hz
        while waiting and round(waiting[0].timestamp - start, 6) <= now:
            live.take(waiting[0], round(waiting.pop(0).timestamp - start, 6))
        expected = [signal / FULL for signal in live.signals(now)[0]]
        assert device.read(Tick(number, 0.0, 0.0), make_frame(run))[:4].tolist() == expected


def test_an_asc_log_whose_times_count_from_frame_to_frame_is_played_at_its_pace(
    tmp_path: Path,
) -> None:
    """Vector's loggers write either; python-can's reader adds nothing up."""
    absolute = a_log(tmp_path / "panel.asc")
    text, was = absolute.read_text(), 0.0
    lines = text.replace("timestamps absolute", "timestamps relative").split("\n")
    for at, line in enumerate(lines):
        if found := re.match(r" *(\d+\.\d+)( .*)", line):
            now = float(found[1])
            lines[at], was = f"{now - was:11.6f}{found[2]}", now
    relative = tmp_path / "relative.asc"
    relative.write_text("\n".join(lines))
    assert "timestamps relative" in relative.read_text()
    found = [
        commands_of(CanReplay(ReplaySettings(file=path, valves=VALVES), ch8()), 1200)
        for path in (absolute, relative)
    ]
    assert found[0] == found[1]


def test_a_log_whose_clock_was_set_back_is_refused_with_the_frame(tmp_path: Path) -> None:
    path = a_log(tmp_path / "panel.log")
    first, *rest = path.read_text().splitlines()
    path.write_text("\n".join([first, *rest, first]) + "\n")
    said = rf"the clock of .*panel.log goes back by .* s at its frame {len(rest) + 2}"
    with pytest.raises(ProtocolError, match=said):
        CanReplay(ReplaySettings(file=path, valves=VALVES), ch8())


def test_what_is_no_log_is_refused_in_words(tmp_path: Path) -> None:
    (tmp_path / "empty.log").write_text("", encoding="utf-8")
    with pytest.raises(ProtocolError, match=r"empty.log holds no frames, so there is nothing"):
        CanReplay(ReplaySettings(file=tmp_path / "empty.log", valves=VALVES), ch8())
    with pytest.raises(ProtocolError, match=r"no.asc cannot be read as a candump, asc or blf log"):
        CanReplay(ReplaySettings(file=tmp_path / "no.asc", valves=VALVES), ch8())


# python-can leaves a damaged blf log open until it is collected.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.filterwarnings("ignore::ResourceWarning")
@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("ending", ["log", "asc", "blf", "trc"])
def test_a_damaged_log_is_read_or_refused_in_words(tmp_path: Path, ending: str, seed: int) -> None:
    draw = random.Random(seed)
    whole = a_log(tmp_path / f"panel.{ending}").read_bytes()
    flipped = bytearray(whole)
    for _ in range(3):
        flipped[draw.randrange(len(whole))] = draw.randrange(256)
    path = tmp_path / f"damaged.{ending}"
    settings = ReplaySettings(file=path, valves=VALVES)
    for damaged in (whole[: draw.randrange(1, len(whole))], bytes(flipped), b"?" + whole):
        path.write_bytes(damaged)
        try:
            CanReplay(settings, ch8())
        except ProtocolError as error:
            assert re.search(rf"damaged\.{ending} |the clock of .*damaged", str(error))  # noqa: PT017


def test_a_flooded_bus_holds_the_machine_and_says_so() -> None:
    settings = CanSettings(bus="virtual:flood", valves=VALVES, most_frames_s=300)
    device = CanPanel(settings, ch8())
    run = make_run(ch8(), axes=device.signals)
    with can.Bus(interface="virtual", channel="flood") as bus:
        device.open(run)
        try:
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
        finally:
            device.close()


def test_logs_are_read_as_people_and_loggers_write_them(tmp_path: Path) -> None:
    """A byte order mark, comments, Windows' line ends, a header in German, and none at all."""
    plain = {ending: a_log(tmp_path / f"plain.{ending}") for ending in ("log", "asc")}
    text = {ending: path.read_text() for ending, path in plain.items()}
    frames = re.sub(r"(?m)^(?! *\d+\.\d).*\n", "", text["asc"])
    screen = re.sub(
        r"(?m)^\((\S+)\) (\S+) (\w+)#(\w+).*$",
        lambda m: (
            f" ({m[1]})  {m[2]}  {m[3]}   [{len(m[4]) // 2}]  {' '.join(re.findall('..', m[4]))}"
        ),
        text["log"],
    )
    german = "date Mo M\xe4r 2 11:21:13.191 2026\nbase hex  timestamps absolute\n"
    written = {
        "bom.log": ("\ufeff# by hand\n; twice\n\n" + text["log"]).encode(),
        "windows.log": text["log"].replace("\n", "\r\n").encode(),
        "screen.log": screen.encode(),
        "march.asc": (german + frames).encode("cp1252"),
        "headless.asc": frames.encode(),
    }
    expected = commands_of(CanReplay(ReplaySettings(file=plain["log"], valves=VALVES), ch8()), 1200)
    for name, raw in written.items():
        (tmp_path / name).write_bytes(raw)
        device = CanReplay(ReplaySettings(file=tmp_path / name, valves=VALVES), ch8())
        assert commands_of(device, 1200) == expected, name
        assert "torn" not in device.metadata()


@pytest.mark.parametrize("ending", ["log", "asc"])
def test_a_last_line_that_was_cut_off_is_no_frame_and_is_recorded(
    tmp_path: Path, ending: str
) -> None:
    path = a_log(tmp_path / f"panel.{ending}")
    lines = [
        line for line in path.read_text().splitlines(keepends=True) if re.search(r"\d\.\d", line)
    ]
    whole = CanReplay(ReplaySettings(file=path, valves=VALVES), ch8()).metadata()["frames"]
    frames = [line for line in lines if re.match(r"[ (]*\d+\.\d", line)]
    path.write_text("".join(frames).rstrip()[: -random.Random(ending).randint(1, 9)])
    told = CanReplay(ReplaySettings(file=path, valves=VALVES), ch8()).metadata()
    assert (told["frames"], told["torn"]) == (whole - 1, 1)


def test_the_panel_is_on_one_bus_of_a_log_that_has_several(tmp_path: Path) -> None:
    path = a_log(tmp_path / "panel.log")
    lines = path.read_text().splitlines()
    (bus,) = {line.split()[1] for line in lines}
    foreign = [
        line.replace(f" {bus} ", " other ")
        for line in a_log(tmp_path / "x.log", 5).read_text().splitlines()
    ]
    both = sorted([*lines, *foreign], key=lambda line: float(line[1:].split(")")[0]))
    mixed = tmp_path / "mixed.log"
    mixed.write_text("\n".join(both) + "\n")
    with pytest.raises(
        ProtocolError, match=r"frames of the buses .*; name the panel's, as in bus: "
    ):
        CanReplay(ReplaySettings(file=mixed, valves=VALVES), ch8())
    alone, picked = (
        commands_of(CanReplay(ReplaySettings(file=file, valves=VALVES, bus=bus), ch8()), 1200)
        for file in (path, mixed)
    )
    assert alone == picked
