"""Delays of views and sounds: edges against closed forms, and a sensor of a known delay."""

import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from needs import GRAPHICS, needs
from rehearsal import SHORT, a_study
from tactor_board import serial_board

from labcrane import DeviceError, ProtocolError, StreamError
from labcrane.cli.commands.delay import measure_delay
from labcrane.feedback.delays import delay_in_words, delay_path, read_delays
from labcrane.feedback.measure_delay import measure
from labcrane.feedback.processes import FeedbackProcesses
from labcrane.streams.edges import Change, delay, onsets, steps
from labcrane.testing import Visit, main

STUDY = (
    SHORT
    + """
feedback:
  tone: {use: click}
views:
  window:
    {use: view, display: hidden, renderer: software, size: [160, 90], patch: {on: [trial.start]}}
"""
)


def test_steps_are_found_at_half_height_between_two_samples() -> None:
    times = np.arange(0.0, 2.0, 0.001)
    flips = np.array([0.30043, 0.71181, 1.20005])
    # A slow sensor: each level is approached along a straight line of 8 ms about the flip.
    level = np.zeros_like(times)
    for number, flip in enumerate(flips):
        level += (-1) ** number * np.clip((times - flip) / 0.008 + 0.5, 0.0, 1.0)
    noise = np.random.default_rng(1).normal(0.0, 0.01, len(times))
    found = steps(times, 3.0 + level + noise)
    assert [edge.up for edge in found] == [True, False, True]
    np.testing.assert_allclose([edge.time for edge in found], flips, atol=3e-4)


def test_onsets_are_where_sounds_begin() -> None:
    times = np.arange(0.0, 2.0, 1 / 8000)
    starts = [0.25, 0.7, 1.4]
    sound = np.random.default_rng(1).normal(0.0, 0.001, len(times))
    for start in starts:
        inside = (times >= start) & (times < start + 0.3)
        sound[inside] += np.cos(2 * np.pi * 500 * (times[inside] - start))
    np.testing.assert_allclose([edge.time for edge in onsets(times, sound)], starts, atol=1 / 8000)


def test_a_delay_is_the_mean_over_changes_and_its_spread() -> None:
    late = [0.030, 0.034, 0.032]
    changes = [Change(float(at), up=at % 2 == 0) for at in range(3)]
    seen = [Change(at + more, up=at % 2 == 0) for at, more in enumerate(late)]
    found = delay(changes, [Change(0.01, up=False), *seen], 1000.0)
    assert found.mean_s == pytest.approx(0.032)
    assert found.sd_s == pytest.approx(0.002)
    assert (found.least_s, found.most_s) == pytest.approx((0.030, 0.034))
    assert (found.seen, found.asked, found.sensor_hz) == (3, 3, 1000.0)


def test_a_sensor_that_sees_nothing_is_told_apart() -> None:
    times, noise = np.arange(1000) / 1000, np.random.default_rng(1).normal(0.0, 1.0, 1000)
    with pytest.raises(
        DeviceError, match=r"^the sensor's signal does not have two levels: most of it is"
    ):
        steps(times, noise)
    with pytest.raises(DeviceError, match=r"^the sensor notices nothing: \S+ where it is loud and"):
        onsets(times, noise)
    with pytest.raises(DeviceError, match=r"^the sensor saw 1 of 2 changes; put it where they are"):
        delay([Change(0.0, up=True), Change(1.0, up=False)], [Change(0.1, up=True)], 100.0)


CLICK = '''
import numpy as np
from labcrane import Feedback, Settings, Signal, hookimpl, offer


class ClickSettings(Settings):
    pass


class Click(Feedback):
    """Stands for a sound: what it sounds like is made up by the sensor."""

    signals = (Signal("level", "1"),)

    def present(self, frame):
        return np.array([1.0])


@hookimpl
def labcrane_feedback():
    return [offer("click", ClickSettings, lambda settings, machine: Click())]
'''


@pytest.fixture
def protocol(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A study with a view and a stand-in for a sound, whose plugin is installed."""
    (tmp_path / "click_plugin.py").write_text(CLICK, encoding="utf-8")
    about = tmp_path / "click_plugin-1.dist-info"
    about.mkdir()
    (about / "METADATA").write_text(
        "Metadata-Version: 2.1\nName: click-plugin\nVersion: 1\n", encoding="utf-8"
    )
    (about / "entry_points.txt").write_text("[labcrane]\nclick = click_plugin\n", encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    return a_study(tmp_path, STUDY).path


@contextmanager
def a_sensor(kind: str, name: str, column: str, level: str, delay_s: float) -> Iterator[str]:
    sensor = f"sensor-{os.getpid()}-{time.monotonic_ns()}"
    log = f"labcrane.feedback.{name}"
    program = str(Path(__file__).parents[1] / "helpers" / "sensor.py")
    process = subprocess.Popen(
        [sys.executable, program, kind, sensor, log, column, level, str(delay_s)]
    )
    try:
        yield sensor
    finally:
        process.kill()
        process.wait()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "name", "column", "level"),
    [
        pytest.param("display", "window", "flip.time", "patch", marks=needs(*GRAPHICS)),
        ("audio", "tone", "", "level"),
    ],
)
def test_the_doctor_measures_the_delay_of_a_sensor(
    kind: str, name: str, column: str, level: str, protocol: Path, capsys: pytest.CaptureFixture
) -> None:
    late = 0.0437
    with a_sensor(kind, name, column, level, late) as sensor:
        options = ["--stream", sensor, "--channel", "2", "--count", "6"]
        assert main(["doctor", "--protocol", str(protocol), f"--{kind}", *options]) == 0
    said = capsys.readouterr().out
    assert "6 of 6 changes seen at 1000 Hz" in said
    found = read_delays(protocol)[name]
    # A change lies anywhere between two samples of 1 ms: the standard deviation is 0.29 ms.
    assert abs(found.delay.mean_s - late) < 0.5e-3
    assert found.delay.sd_s < 0.5e-3
    assert found.kind == kind
    assert main(["doctor", "--protocol", str(protocol), f"--{kind}"]) == 0
    again = capsys.readouterr().out
    assert f"{name}: delay 4" in again
    assert "6 changes" in again
    if kind == "display":
        the_record_says_it(protocol)


@needs("g++")
@pytest.mark.slow
@pytest.mark.quiet
def test_the_doctor_measures_the_delay_of_a_vibration(
    tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    late, sensor = 0.0437, f"accelerometer-{os.getpid()}-{time.monotonic_ns()}"
    with serial_board(tmp_path) as board:
        pulse = f"\nfeedback:\n  pulse: {{use: vibration, port: {board.address}}}\n"
        protocol = a_study(tmp_path, SHORT + pulse).path
        program = Path(__file__).parents[1] / "helpers" / "accelerometer.py"
        process = subprocess.Popen([sys.executable, program, sensor, board.log, str(late)])
        try:
            options = ["--stream", sensor, "--count", "20"]
            assert main(["doctor", "--protocol", str(protocol), "--touch", *options]) == 0
        finally:
            process.kill()
            process.wait()
    assert "vibration pulse: delay 4" in capsys.readouterr().out
    found = read_delays(protocol)["pulse"]
    # Alone it is within a millisecond; on a busy computer a line, or its stamp, waits for a moment.
    assert abs(found.delay.mean_s - late) < 5e-3
    assert found.kind == "touch"


def the_record_says_it(protocol: Path) -> None:
    study = a_study(protocol.parent, STUDY.replace("feedback:\n  tone: {use: click}", ""))
    processes = FeedbackProcesses(Visit(study, "P001", 1, protocol.parent, simulated=True))
    try:
        assert processes.wait(lambda said: None, lambda: False)
        (handle,) = processes.handles
    finally:
        processes.stop()
    assert re.search(r"delay 4\d\.\d ms \(sd 0\.\d ms, 6 changes, \d+-\d+-\d+\)$", handle.facts)


def test_without_a_sensor_delays_are_not_measured(
    protocol: Path, capsys: pytest.CaptureFixture
) -> None:
    assert main(["doctor", "--protocol", str(protocol), "--display", "--audio"]) == 0
    said = capsys.readouterr().out
    assert "view window: delay not measured" in said
    assert "sound tone: delay not measured" in said
    assert "Fix the photodiode over the square in a corner of view 'window'" in said
    assert not delay_path(protocol).exists()


def test_what_cannot_be_measured_is_said(protocol: Path) -> None:
    text = protocol.read_text(encoding="utf-8")
    with pytest.raises(ProtocolError, match="there is no sound 'wall'; there is tone"):
        measure_delay("audio", protocol, "s", "wall", 2, 1)
    bare = a_study(protocol.parent, text.replace(", patch: {on: [trial.start]}", ""))
    with pytest.raises(ProtocolError, match=r"view 'window' has no patch for a photodiode; write"):
        measure(bare, "display", "window", "s", 2)


def test_a_sensor_that_is_not_there_is_said(
    protocol: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("labcrane.feedback.measure_delay.WAIT_S", 0.2)
    with pytest.raises(StreamError, match="there is no stream 'diode'; labcrane streams lists"):
        measure(a_study(protocol.parent, STUDY), "display", "window", "diode", 2)


def test_a_delay_holds_for_what_was_measured_only(protocol: Path) -> None:
    one = {"mean_s": 0.03, "sd_s": 0.001, "least_s": 0.02, "most_s": 0.04}
    about = {"kind": "display", "date": "2026-03-01", "sensor": "diode"}
    found = {**about, "delay": {**one, "seen": 9, "asked": 9, "sensor_hz": 1e3}}
    delay_path(protocol).write_text(
        json.dumps({"window": {**found, "facts": {"size": "1x1"}}}), encoding="utf-8"
    )
    measured = read_delays(protocol)["window"]
    here = {"size": "1x1", "delay": "not measured"}
    assert delay_in_words(measured, here) == "30.0 ms (sd 1.0 ms, 9 changes, 2026-03-01)"
    other = delay_in_words(measured, {"size": "2x2"})
    assert other == "not measured as it is now (size was '1x1', is '2x2')"
    delay_path(protocol).write_text("{}}", encoding="utf-8")
    with pytest.raises(ProtocolError, match=r"is damaged .*; remove it and measure again with"):
        read_delays(protocol)
