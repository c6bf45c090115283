"""The screen, grabbed from a real X server: flashes in the frames, and a server that goes."""

import ctypes
import os
import random
import signal
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import av
import numpy as np
import pytest
from faults.sessions import finished, labcrane, wait_for
from faults.test_filmed_session import STUDY, WHO, check_files, size
from needs import GRAPHICS, needs

from labcrane import DeviceError, open_recording
from labcrane.core import Captured
from labcrane_film.film import FilmedSource
from labcrane_film.settings import ScreenSettings

FLASHES = 200
SPARE = 20
pytestmark = [pytest.mark.slow, needs("Xvfb")]


@contextmanager
def x_server(display: str | None = None) -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """Run a virtual screen of 320 by 240 pixels; yield its display and its process."""
    reading, writing = os.pipe()
    named = [display] if display else []
    command = ["Xvfb", *named, "-screen", "0", "320x240x24", "-nolisten", "tcp"]
    command += ["-displayfd", str(writing)]
    server = subprocess.Popen(command, pass_fds=[writing], stderr=subprocess.DEVNULL)
    os.close(writing)
    try:
        with os.fdopen(reading) as told:
            yield f":{told.readline().strip()}", server
    finally:
        server.kill()
        server.wait()


class Flasher:
    """Turns the whole screen black or white, by Xlib alone."""

    def __init__(self, display: str) -> None:
        self._x = ctypes.CDLL("libX11.so.6")
        self._x.XOpenDisplay.restype = ctypes.c_void_p
        self._x.XDefaultRootWindow.restype = ctypes.c_ulong
        self._display = ctypes.c_void_p(self._x.XOpenDisplay(display.encode()))
        self._root = ctypes.c_ulong(self._x.XDefaultRootWindow(self._display))

    def turn(self, colour: int) -> tuple[float, float]:
        """Return between which times the screen turned, on the session's clock."""
        before = time.perf_counter()
        self._x.XSetWindowBackground(self._display, self._root, ctypes.c_ulong(colour))
        self._x.XClearWindow(self._display, self._root)
        self._x.XSync(self._display, 0)
        return before, time.perf_counter()

    def close(self) -> None:
        self._x.XCloseDisplay(self._display)


def test_the_frame_in_which_a_flash_is_seen_is_stamped_within_its_uncertainty(
    tmp_path: Path,
) -> None:
    path, dice = tmp_path / "screen.mkv", random.Random(76)
    told: list[Captured] = []
    flashes: list[tuple[float, float]] = []
    darkenings: list[tuple[float, float]] = []
    with x_server() as (display, _):
        flasher = Flasher(display)
        flasher.turn(0)
        film = FilmedSource(ScreenSettings(display=display, rate_hz=30, consent="we film"))
        film.begin()
        film.write_to(path)

        def flash() -> None:
            time.sleep(0.5)
            for _ in range(FLASHES + SPARE):
                flashes.append(flasher.turn(0xFFFFFF))
                time.sleep(dice.uniform(0.09, 0.12))
                darkenings.append(flasher.turn(0))
                time.sleep(dice.uniform(0.09, 0.12))

        thread = threading.Thread(target=flash)
        thread.start()
        while thread.is_alive():
            told += film.read()
        told += film.end()
        film.close()
        flasher.close()
    with av.open(str(path)) as file:
        light = np.array([frame.to_ndarray(format="gray").mean() for frame in file.decode(0)])
    assert len(light) == len(told)
    seen = np.flatnonzero((light[1:] > 128) & (light[:-1] < 128)) + 1
    assert len(seen) >= FLASHES  # a busy computer may drop the frames of others
    before, after = np.array(flashes).T
    within = 0
    for at in seen:
        dark, bright = told[at - 1], told[at]
        known = bright.time + bright.clock + bright.arrival + bright.lag
        # It came after the last dark frame was grabbed, and before the bright one was there.
        within += bool(((after >= dark.time - dark.clock) & (before <= known)).any())
    assert within == len(seen)
    # Nor is any frame dark that was grabbed, by its stamp, while the screen was bright.
    ends = np.array(darkenings)[:, 0]
    for frame, grey in zip(told, light, strict=True):
        first, last = frame.time - frame.clock, frame.time + frame.clock + frame.arrival
        assert grey > 128 or not ((after <= first) & (last <= ends)).any()
    assert np.median([each.clock + each.arrival for each in told]) < 0.02


def test_the_window_of_a_view_is_recorded_wherever_it_is(tmp_path: Path) -> None:
    path = tmp_path / "screen.mkv"
    with x_server() as (display, _):
        flasher = Flasher(display)
        flasher.turn(0)
        x, root = flasher._x, flasher._root
        x.XCreateSimpleWindow.restype = ctypes.c_ulong
        for left, colour, title in ((10, 0xFFFFFF, b"another"), (120, 0x808080, b"labcrane: main")):
            window = ctypes.c_ulong(
                x.XCreateSimpleWindow(flasher._display, root, left, 30, 96, 64, 0, 0, colour)
            )
            x.XStoreName(flasher._display, window, title)
            x.XMapWindow(flasher._display, window)
        x.XSync(flasher._display, 0)
        film = FilmedSource(ScreenSettings(display=display, of="main", consent="we film"))
        film.windows = {"main": "labcrane: nowhere"}
        with pytest.raises(DeviceError, match="has no window 'labcrane: nowhere'; open the view"):
            film.begin()
        film.windows = {"main": "labcrane: main"}
        film.begin()
        film.write_to(path)
        told = [frame for _ in range(8) for frame in film.read()]
        told += film.end()
        film.close()
        flasher.close()
    with av.open(str(path)) as file:
        frames = [frame.to_ndarray(format="gray") for frame in file.decode(0)]
    assert len(frames) == len(told) == 8
    assert frames[-1].shape == (64, 96)
    np.testing.assert_allclose(frames[-1], 128, atol=4)


FLASHED = """\
views:
  main:
    {use: view, renderer: software, size: [120, 120],
     patch: {on: [trial.start], corner: top_left}}
recordings:
  screen:
    {use: screen, of: main, consent: the screen, sees: main, sees_part: [4, 4, 40, 40]}
"""


@needs(*GRAPHICS)
def test_a_session_measures_how_late_its_own_view_is_in_the_film(tmp_path: Path) -> None:
    protocol, data = tmp_path / "study.yaml", tmp_path / "data"
    plain = STUDY[: STUDY.index("recordings:")].replace("study: filmed", "study: filmed_view")
    protocol.write_text(plain + FLASHED)
    with x_server() as (display, _):
        env = {**os.environ, "DISPLAY": display}
        said = finished(labcrane("run", protocol, *WHO, data, "--feedback", env=env))
    folder = data / "P001-SIMULATED"
    session = open_recording(folder / f"{folder.name}.h5").session(1)
    (found,) = session.sync_report["loop_back"]
    assert (found["channel"], found["of"], found["verdict"]) == ("level", "main", "PASS"), dict(
        found
    )["findings"]
    assert found["delay"]["seen"] == found["delay"]["asked"] > 3
    assert -0.15 < found["delay"]["mean_s"] < 0.2  # a picture in the computer, and a busy one
    assert "a lag of 0.00 ms is declared, and with it" in said
    with av.open(str(folder / "ses-01_screen.mkv")) as file:
        assert (file.streams[0].width, file.streams[0].height) == (120, 120)


def test_a_screen_that_goes_and_comes_back_is_recorded_again(tmp_path: Path) -> None:
    protocol, data = tmp_path / "study.yaml", tmp_path / "data"
    folder = data / "P001-SIMULATED"
    recordings = "recordings:\n  screen: {{use: screen, display: '{}', consent: we film}}\n"
    plain = STUDY[: STUDY.index("recordings:")].replace("study: filmed", "study: filmed_screen")
    with x_server() as (display, server):
        protocol.write_text(plain + recordings.format(display))
        launcher = labcrane("run", protocol, *WHO, data)
        wait_for(lambda: size(folder / "ses-01_screen.mkv") > 0)
        wait_for(lambda: size(folder / "ses-01_run.xdf") > 300_000)
        server.send_signal(signal.SIGKILL)
        server.wait()
    with x_server(display):
        said = finished(launcher)
    assert "recording screen: failed: " in said
    assert "recording screen: is written to ses-01_screen.2.mkv" in said
    check_files(folder, "screen", files=2)
