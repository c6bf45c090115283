"""The keyboard: ramps against closed forms, and real keys in a real window."""

import os
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import numpy as np
import pylsl
import pytest
from faults.sessions import wait_for
from gone_stream import goes_once
from needs import needs
from pydantic import ValidationError
from windows import an_x_server

from labcrane import InputDevice, ProtocolError, Tick
from labcrane.testing import RATE_HZ, InputContract, ch8, make_frame, make_run
from labcrane_keyboard.keyboard import Keyboard
from labcrane_keyboard.settings import KeyboardSettings
from labcrane_view.settings import ViewSettings
from labcrane_view.view import View

AXES = {"slew": ("a", "d"), "shoulder": ("arrow_down", "arrow_up")}


class TestKeyboard(InputContract):
    """Offered as "keyboard"."""

    @pytest.fixture
    def device(self) -> InputDevice:
        return Keyboard(KeyboardSettings(view="nobody", axes=AXES))


class Desk:
    """A keyboard that is read tick by tick, on a clock of its own."""

    def __init__(self, view: str, **settings: object) -> None:
        self.keyboard = Keyboard(KeyboardSettings(view=view, axes=AXES, **settings))
        self._run = make_run(ch8(), axes=self.keyboard.signals)
        self._number = 0
        self.keyboard.open(self._run)

    def read(self, ticks: int = 1) -> np.ndarray:
        """Return what each of the next ticks reads, shape ``(ticks, 3)``."""
        rows = []
        for _ in range(ticks):
            self._number += 1
            now = self._number / RATE_HZ
            frame = make_frame(self._run, self._number)
            rows.append(self.keyboard.read(Tick(self._number, now, now), frame).copy())
        return np.array(rows)

    def read_until(self, condition: object) -> np.ndarray:
        """Read in real time until what is read is as wanted."""
        deadline = time.monotonic() + 240.0
        while not condition(row := self.read()[0]):
            assert time.monotonic() < deadline, f"last read {row}; {self.keyboard.fault}"
            time.sleep(1 / RATE_HZ)
        return row


def keys_outlet(keys: Iterable[str]) -> tuple[str, pylsl.StreamOutlet]:
    """Stand in for a view that sends its keys' states; return its name too."""
    view = f"view{time.monotonic_ns()}"
    labels = ["frame.tick", *(f"key.{key}" for key in keys)]
    info = pylsl.StreamInfo(
        f"labcrane.feedback.{view}.keys", "Feedback", len(labels), 0, "double64", view
    )
    channels = info.desc().append_child("channels")
    for label in labels:
        channels.append_child("channel").append_child_value("label", label)
    return view, pylsl.StreamOutlet(info)


@contextmanager
def a_view_that_sends(
    keys: tuple[str, ...], **settings: object
) -> Iterator[tuple[Desk, pylsl.StreamOutlet]]:
    """Stand in for a view, whose samples are given by hand."""
    view, outlet = keys_outlet(keys)
    desk = Desk(view, **settings)
    with closing(desk.keyboard):
        keys = desk.keyboard._keys
        wait_for(lambda: keys.connected or keys.complaint)
        yield desk, outlet


def press(desk: Desk, outlet: pylsl.StreamOutlet, *states: float) -> None:
    """Send the keys' states, and wait until they have come: a ramp begins with the next tick."""
    outlet.push_sample([0.0, *states])
    wait_for(desk.keyboard._keys._inlet.samples_available)


ORDER = ("a", "arrow_up", "d", "arrow_down")  # not the order in which axes name them


def test_a_held_key_drives_its_axis_along_a_ramp_and_back() -> None:
    with a_view_that_sends(ORDER, ramp_s=0.25, fall_s=0.125, timeout_s=9.0) as (desk, outlet):
        press(desk, outlet, 1, 0, 0, 0)
        slew, shoulder, connected = desk.read(90).T
        np.testing.assert_allclose(slew, -np.minimum(np.arange(1, 91) / 60, 1.0), atol=1e-12)
        assert not shoulder.any()
        assert (connected == 1).all()
        press(desk, outlet, 0, 1, 0, 0)
        slew, shoulder, _ = desk.read(90).T
        np.testing.assert_allclose(slew, -np.maximum(1.0 - np.arange(1, 91) / 30, 0.0), atol=1e-12)
        np.testing.assert_allclose(shoulder, np.minimum(np.arange(1, 91) / 60, 1.0), atol=1e-12)


def test_without_ramps_a_key_is_all_or_nothing_and_two_cancel() -> None:
    with a_view_that_sends(ORDER, ramp_s=0.0, fall_s=0.0, timeout_s=9.0) as (desk, outlet):
        for states, expected in (
            ((0, 0, 1, 1), (1.0, -1.0)),
            ((1, 0, 1, 0), (0.0, 0.0)),
            ((1, 1, 0, 0), (-1.0, 1.0)),
        ):
            press(desk, outlet, *states)
            assert tuple(desk.read()[0, :2]) == expected


def test_a_silent_view_is_a_lost_input_and_stops_the_machine_at_once() -> None:
    with a_view_that_sends(ORDER, timeout_s=0.5) as (desk, outlet):
        press(desk, outlet, 0, 0, 1, 0)
        rows = desk.read(121)
        assert (rows[:, 2] == 1).all()
        assert desk.keyboard.fault is None
        assert desk.read()[0].tolist() == [0.0, 0.0, 0.0]
        assert desk.keyboard.fault.endswith("has sent no keys for 0.5 s; its window may be closed")
        press(desk, outlet, 0, 0, 0, 0)
        assert desk.read()[0].tolist() == [0.0, 0.0, 1.0]  # a key held before has to be let go
        assert desk.keyboard.fault is None


@pytest.mark.slow
def test_a_view_without_the_keys_is_told_apart_from_none() -> None:
    with a_view_that_sends(("a", "d")) as (desk, _):
        desk.read()
        assert desk.keyboard.fault.endswith(
            "sends the keys a, d; the keyboard also needs arrow_down, arrow_up: "
            "write them under its keys"
        )
    desk = Desk("nobody")
    desk.read()
    desk.keyboard.close()
    assert desk.keyboard.fault == (
        "no view 'nobody' sends keys; write keys: [a, d, arrow_down, arrow_up] under views: nobody"
    )


def test_a_view_that_goes_while_it_is_found_is_found_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    goes_once(monkeypatch)
    with a_view_that_sends(ORDER, timeout_s=9.0) as (desk, outlet):
        desk.read_until(lambda row: row[2] == 1.0)
        press(desk, outlet, 0, 0, 1, 0)
        assert desk.read(240)[-1].tolist() == [1.0, 0.0, 1.0]


def test_a_key_moves_one_axis_only() -> None:
    with pytest.raises(ValidationError, match="a key can move one axis only; a moves more"):
        KeyboardSettings(view="v", axes={"x": ("a", "b"), "y": ("a", "c")})


def test_a_key_that_does_not_exist_is_refused() -> None:
    with pytest.raises(ProtocolError, match="there is no key 'any'; keys are single letters"):
        View(ViewSettings(keys=("a", "any")), ch8())


@contextmanager
def a_window(view: str, display: str) -> Iterator["subprocess.Popen[str]"]:
    """Open a view in a process of its own, as a session does."""
    process = subprocess.Popen(
        [sys.executable, str(Path(__file__).with_name("key_window.py")), view],
        env={**os.environ, "DISPLAY": display},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        encoding="utf-8",
    )
    try:
        assert process.stdout.readline() == "ready\n"
        yield process
    finally:
        process.kill()
        process.wait()
        process.stdin.close()
        process.stdout.close()


@pytest.mark.slow
@needs("xdotool", "Xvfb")
def test_real_keys_in_a_real_window_move_the_axes() -> None:
    view = f"window{os.getpid()}"

    def tell(*what: str) -> str:
        environment = {**os.environ, "DISPLAY": display}
        done = subprocess.run(
            ["xdotool", *what], env=environment, check=True, capture_output=True, encoding="utf-8"
        )
        return done.stdout.strip()

    def focus(*where: str) -> None:
        tell("windowfocus", tell("search", *where))

    with an_x_server() as display, a_window(view, display) as window:
        focus("--name", "^labcrane$")
        desk = Desk(view, ramp_s=0.0, fall_s=0.0)
        with closing(desk.keyboard):
            desk.read_until(lambda row: row[2] == 1)
            tell("keydown", "d", "keydown", "Down")
            desk.read_until(lambda row: row.tolist() == [1.0, -1.0, 1.0])
            tell("keyup", "Down")
            desk.read_until(lambda row: row.tolist() == [1.0, 0.0, 1.0])
            focus("--maxdepth", "0", "")  # the desktop takes the focus, with a key held
            desk.read_until(lambda row: row.tolist() == [0.0, 0.0, 1.0])
            tell("keyup", "d")
            focus("--name", "^labcrane$")
            tell("keydown", "a")
            desk.read_until(lambda row: row.tolist() == [-1.0, 0.0, 1.0])
            window.kill()
            desk.read_until(lambda row: row.tolist() == [0.0, 0.0, 0.0])
            assert "its window may be closed" in desk.keyboard.fault
            tell("keyup", "a")
            with a_window(view, display):
                desk.read_until(lambda row: row.tolist() == [0.0, 0.0, 1.0])
                focus("--name", "^labcrane$")
                tell("keydown", "a")
                desk.read_until(lambda row: row.tolist() == [-1.0, 0.0, 1.0])
