"""The sticks and the system they are attached to: SDL, the kernel, the environment."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from programs import ran
from virtual_sticks import open_fails

from labcrane_joystick import sdl
from labcrane_joystick.kernel import ABSINFO, axis_codes, fuzz_and_flat, read_request
from labcrane_joystick.stick import open_nodes, socket_of


@pytest.fixture(autouse=True)
def config(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LABCRANE_CONFIG", str(tmp_path))


def test_no_stick_is_an_error_that_says_so(table):
    assert open_fails() == (
        "two joysticks 044f:b10a are needed, but none of that model is attached; attached: "
        "no joystick at all; plug in two, or name another model as 'stick: vendor:product'"
    )


def test_one_stick_is_an_error_that_names_what_is_attached(table):
    table.plug()
    table.plug(name="Pad", model=(0x045E, 0x028E), axes=6, buttons=11)
    assert open_fails() == (
        "two joysticks 044f:b10a are needed, but 1 of that model is attached; attached: "
        "Thrustmaster T.16000M (044f:b10a, 4 axes, 16 buttons), "
        "Pad (045e:028e, 6 axes, 11 buttons); "
        "plug in two, or name another model as 'stick: vendor:product'"
    )


@pytest.mark.parametrize(("axes", "buttons"), [(3, 16), (4, 0)])
def test_a_stick_that_lacks_axes_or_buttons_is_an_error_with_numbers(table, axes, buttons):
    table.plug()
    table.plug(axes=axes, buttons=buttons)
    assert open_fails() == (
        f"joystick 'Thrustmaster T.16000M' (044f:b10a) has {axes} axes and {buttons} buttons, "
        "but 4 axes (x, y, twist, slider) and 1 button (trigger) are needed; plug in another "
        "model and name it as 'stick: vendor:product'"
    )


def test_three_sticks_that_nobody_told_apart_are_an_error(table):
    for _ in range(3):
        table.plug()
    assert open_fails() == (
        "3 joysticks of the model are attached, and none is known as left or right; run "
        "'python -m labcrane_joystick' to identify and calibrate the sticks, or unplug "
        "all but two"
    )


def test_a_socket_is_found_by_the_node_the_process_opened(tmp_path):
    nodes, by_path = tmp_path / "input", tmp_path / "input" / "by-path"
    by_path.mkdir(parents=True)
    for number in (3, 4):
        (nodes / f"event{number}").touch()
    (by_path / "pci-usb-0:1-event-joystick").symlink_to("../event3")
    (by_path / "pci-usb-0:2-event-joystick").symlink_to("../event4")
    (by_path / "pci-usbv2-0:2-event-joystick").symlink_to("../event4")
    before = open_nodes(nodes)
    with (nodes / "event4").open("rb"):
        (node,) = open_nodes(nodes) - before
        assert socket_of(node, nodes) == "pci-usb-0:2-event-joystick"
    assert open_nodes(nodes) == before == set()
    assert socket_of(None, nodes) is None


def test_fuzz_and_flat_are_read_with_the_kernels_own_numbers():
    # As printed by the C macros EVIOCGABS(ABS_X) and EVIOCGBIT(EV_ABS, 8).
    assert read_request(0x40, ABSINFO.size) == 0x80184540
    assert read_request(0x23, 8) == 0x80084523
    # A T.16000M: X, Y, RZ, THROTTLE, and a hat that SDL does not count as axes.
    bits = sum(1 << code for code in (0, 1, 5, 6, 16, 17)).to_bytes(8, sys.byteorder)
    assert axis_codes(bits) == [0, 1, 5, 6]
    assert fuzz_and_flat(ABSINFO.pack(8000, 0, 16383, 63, 1023, 0)) == (63, 1023)


def run_python(code: str, **environment: str) -> subprocess.CompletedProcess[str]:
    inherited = {k: v for k, v in os.environ.items() if k not in sdl.ENVIRONMENT}
    return subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        env=inherited | environment,
        capture_output=True,
        encoding="utf-8",
        check=False,
        timeout=240,
    )


@pytest.mark.slow
def test_opening_is_silent_and_leaves_the_environment_as_it_was():
    code = (
        "import os; before = dict(os.environ)\n"
        "from labcrane import DeviceError\n"
        "from labcrane.testing import make_run, ch8\n"
        "from labcrane_joystick.dual_joystick import DualJoystick\n"
        "from labcrane_joystick.settings import JoystickSettings\n"
        "try: DualJoystick(JoystickSettings(stick='ffff:fffe')).open(make_run(ch8()))\n"
        "except DeviceError: pass\n"
        "import pygame; print(pygame.display.get_driver(), dict(os.environ) == before)"
    )
    done = run_python(code)
    assert (done.stdout, done.stderr) == ("dummy True\n", "")


def test_a_video_driver_the_user_chose_stands():
    code = (
        "from labcrane_joystick import sdl; sdl.start()\n"
        "import pygame; print(pygame.display.get_driver())"
    )
    assert run_python(code, SDL_VIDEODRIVER="offscreen").stdout == "offscreen\n"


def test_the_process_can_still_be_terminated():
    code = (
        "import os, signal, time; from labcrane_joystick import sdl; sdl.start()\n"
        "os.kill(os.getpid(), signal.SIGTERM); time.sleep(5)"
    )
    assert run_python(code).returncode == -signal.SIGTERM


def test_the_program_without_sticks_ends_with_the_error_and_no_traceback():
    done = ran([sys.executable, "-m", "labcrane_joystick", "--stick", "ffff:fffe"], timeout=240)
    assert done.returncode == 1
    assert done.stderr.startswith("two joysticks ffff:fffe are needed, but none of that model")
    assert len(done.stderr.splitlines()) == 1


def test_a_video_driver_that_does_not_exist_is_named():
    code = "from labcrane_joystick import sdl; sdl.start()"
    done = run_python(code, SDL_VIDEODRIVER="nonesuch")
    assert "DeviceError: SDL does not start: nonesuch not available" in done.stderr
    assert "unset SDL_VIDEODRIVER" in done.stderr
