"""The looks at CAN, displays and sound, with an adapter on a pty, Xvfb and ALSA's null device."""

import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from needs import GRAPHICS, needs
from programs import ran
from rehearsal import SHORT
from slcan_adapter import SlcanAdapter
from windows import an_x_server

from labcrane import Offer, Settings
from labcrane.analysis.presented import PresentedLimits
from labcrane.core import Finding, Verdict
from labcrane.feedback.picture_rate import judged
from labcrane.testing import ExaminationContract, main
from labcrane_can import labcrane_inputs
from labcrane_can.avc import encode
from labcrane_can.examination import examine
from labcrane_can.settings import CanSettings
from labcrane_sonification import labcrane_feedback as sounds
from labcrane_view import labcrane_feedback as views
from labcrane_view.screen.monitors import parse_rates
from labcrane_view.settings import ViewSettings

VALVES = {"boom": 1, "arm": 2}


class TestCan(ExaminationContract):
    @pytest.fixture
    def offered(self) -> Offer:
        return labcrane_inputs()[0]

    @pytest.fixture
    def settings(self) -> Settings:
        return CanSettings(bus="virtual:doctor", valves=VALVES)


@pytest.mark.slow
@needs("Xvfb", *GRAPHICS)
def test_the_doctor_draws_the_studys_own_picture_and_says_how_many_come_a_second(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    said = {}
    with an_x_server() as display:
        monkeypatch.setenv("DISPLAY", display)
        for rate in (8, 20):
            view = f"views: {{cab: {{use: view, size: [320, 180], rate_hz: {rate}}}}}\n"
            (tmp_path / "protocol.yaml").write_text(SHORT + view, encoding="utf-8")
            main(["doctor", "--protocol", str(tmp_path), "--local"])
            lines = capsys.readouterr().out.splitlines()
            (said[rate],) = [line for line in lines if "pictures a second of this study" in line]
    found = {rate: float(line.split()[4]) for rate, line in said.items()}
    assert 4.0 <= found[8] <= 8.0
    assert found[8] + 2.0 <= found[20] <= 20.0  # a busy computer shows fewer
    assert said[8].startswith("FAIL view cab: shows ")
    assert said[8].endswith(
        "a second of this study; 15 are needed, so that no movement would be included"
    )
    assert said[20].startswith(f"{judged(found[20], PresentedLimits()).verdict.value} view cab:")


@pytest.mark.parametrize(
    ("rate_hz", "verdict"), [(14.9, "FAIL"), (15.0, "WARN"), (29.9, "WARN"), (30.0, "PASS")]
)
def test_pictures_are_enough_with_some_to_spare(rate_hz: float, verdict: str) -> None:
    assert judged(rate_hz, PresentedLimits()).verdict.value == verdict


class TestView(ExaminationContract):
    @pytest.fixture
    def offered(self) -> Offer:
        return views()[0]

    @pytest.fixture
    def settings(self) -> Settings:
        return ViewSettings(display="hidden", size=(64, 48))


@needs("alsa.conf")
class TestSound(ExaminationContract):
    @pytest.fixture
    def offered(self) -> Offer:
        return sounds()[0]

    @pytest.fixture
    def settings(self) -> Settings:
        return sounds()[0].settings()


def listened(adapter: SlcanAdapter, *frames: tuple[int, bytes]) -> list[Finding]:
    """Look at a bus on which ``frames`` are sent over and over."""
    over = threading.Event()

    def send() -> None:
        while not over.wait(0.02):
            for frame in frames:
                adapter.send(*frame)

    sender = threading.Thread(target=send)
    sender.start()
    try:
        return examine(CanSettings(bus=f"slcan:{adapter.path}", valves=VALVES), None)
    finally:
        over.set()
        sender.join()
        adapter.unplug()


def test_a_panel_that_commands_every_valve_passes() -> None:
    found = listened(SlcanAdapter(), encode(1, 100, 0x25), encode(2, -50, 0x25))
    assert [finding.verdict for finding in found] == [Verdict.PASS, Verdict.PASS]
    assert found[0].text.endswith("frames a second from 0x25")
    assert found[1].text == "the panel commands boom, arm"


def test_a_valve_that_nobody_commands_is_named() -> None:
    traffic, heard, silent = listened(SlcanAdapter(), encode(1, 100, 0x25), encode(7, 0, 0x25))
    assert traffic.verdict is heard.verdict is Verdict.PASS
    assert silent.verdict is Verdict.FAIL
    assert silent.text.startswith("no command for arm within 1 s (")
    assert "frames were not for these valves" in silent.text


def test_a_silent_bus_and_no_adapter_are_told_apart(tmp_path: Path) -> None:
    silent, *_ = listened(SlcanAdapter())
    assert silent.text.endswith("is open and silent")
    assert "switch the panel on" in silent.advice
    (missing,) = examine(CanSettings(bus=f"slcan:{tmp_path}/none", valves=VALVES), None)
    assert "cannot be opened" in missing.text
    assert missing.advice == "plug the adapter in, and check name and permissions"


@pytest.fixture(scope="module")
def x_server() -> Iterator[str]:
    with an_x_server() as display:
        yield display


def in_a_process(plugin: str, **environment: str) -> str:
    """Return what an examination finds, a line each, in a process of its own."""
    code = (
        f"from {plugin} import labcrane_feedback\n"
        "(offer,) = labcrane_feedback()\n"
        "for one in offer.examine(offer.settings(), None): print(one.verdict, one.text, one.advice)"
    )
    done = ran([sys.executable, "-c", code], env=environment)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_display_is_looked_at_with_what_draws(x_server: str) -> None:
    found = in_a_process("labcrane_view", DISPLAY=x_server)
    assert "draws a window of 1000 x 562 pixels" in found  # whole, on a screen of 1000 x 700
    assert "WARN" in found  # nothing but software draws on it
    assert "tearing is not known: the monitor's refresh rate is not" in found
    assert "FAIL there is no display" in in_a_process("labcrane_view", DISPLAY="")


def test_the_refresh_rate_is_the_one_with_the_star() -> None:
    # As xrandr 1.5 prints a laptop with a beamer.
    listed = (
        "Screen 0: minimum 320 x 200, current 3840 x 1080, maximum 16384 x 16384\n"
        "eDP-1 connected primary 1920x1080+0+0 (normal left inverted) 344mm x 194mm\n"
        "   1920x1080     60.05*+  40.04  \n"
        "   1680x1050     60.05  \n"
        "HDMI-1 connected 1920x1080+1920+0 (normal left inverted) 1210mm x 680mm\n"
        "   3840x2160     30.00 +\n"
        "   1920x1080    120.00    60.00    24.00* \n"
        "DP-1 disconnected (normal left inverted)\n"
    )
    assert parse_rates(listed) == [("eDP-1", 60.05), ("HDMI-1", 24.0)]


def test_a_sound_device_is_named_with_its_block(tmp_path: Path) -> None:
    found = in_a_process("labcrane_sonification", ALSA_CONFIG_PATH=null_device(tmp_path))
    assert "takes 48000 Hz in blocks of 256 samples: 5.3 ms each" in found


def test_a_sound_device_is_opened_without_being_started(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Once started, it cannot be stopped for certain: see labcrane_sonification.examination.
    code = (
        "import pyo\n"
        "pyo.Server.start = pyo.Server.stop = lambda self: print('touched')\n"
        "from labcrane_sonification import labcrane_feedback\n"
        "(offer,) = labcrane_feedback()\n"
        "for one in offer.examine(offer.settings(), None): print(one.verdict, one.text)"
    )
    monkeypatch.setenv("ALSA_CONFIG_PATH", null_device(tmp_path))
    done = ran([sys.executable, "-c", code], check=True)
    assert "touched" not in done.stdout
    assert "PASS sound device" in done.stdout


def null_device(folder: Path) -> str:
    """Return an ALSA configuration whose only device takes everything and sounds nothing."""
    config = folder / "asoundrc"
    config.write_text("pcm.!default { type null }\nctl.!default { type null }\n")
    return str(config)


@needs("alsa.conf", "no sound card")
def test_a_computer_without_sound_fails_and_does_not_crash() -> None:
    assert in_a_process("labcrane_sonification").startswith(
        "FAIL there is no sound output device connect one"
    )
