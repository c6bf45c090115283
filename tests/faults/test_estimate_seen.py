"""Steps in a stream of another clock, until they are seen in a picture."""

from pathlib import Path

import numpy as np
import pytest
from faults.sessions import labcrane, unique
from needs import needs
from simple_crane import CRANE
from streams.emulation import Lab, Skew, build
from windows import an_x_server

from labcrane import open_recording

STEP_S = 0.618
"""Of the level: neither ticks nor pictures come at a fixed time after it."""

RATE_HZ, CHUNK = 250.0, 20
WINDOW_S = CHUNK / RATE_HZ
"""The device sends so many samples together, and the estimate takes the last of them."""

STUDY = (
    """\
labcrane: 1
study: seen
title: A study whose sphere follows an estimate
rate_hz: 240
"""
    + CRANE
    + """\
streams:
  eeg: {name: DEVICE}
estimates:
  step: {use: step, stream: eeg, fallback: {level: 0, sampled: -1}}
tasks:
  aiming: {use: aiming, distances: [1], movements: 28, limit_s: 8, end: trigger}
feedback:
  ball:
    use: sphere
    opacity: {estimate: step.level, between: [0, 1], to: [0.1, 0.9], at_most_per_s: 1000}
views:
  screen: {use: view, size: [320, 240], rate_hz: 60}
sessions:
  - {name: only, steps: [{block: {task: aiming, pairs: 1, feedback: [ball]}}]}
"""
)
PLUGIN = f'''\
from typing import ClassVar

from labcrane import Estimate, hookimpl, offer
from labcrane.core import Estimated, EstimateSettings

labcrane_api = 1


class StepSettings(EstimateSettings):
    values: ClassVar = ("level", "sampled")


class Step(Estimate):
    """The newest sample is its true time: the level changes at each multiple of {STEP_S} s."""

    def __init__(self, settings):
        pass

    def begin(self, stream):
        pass

    def update(self, times, samples):
        true = float(samples[-1, 0])
        return Estimated(float(times[-1]), float(times[0]), (true // {STEP_S} % 2.0, true))


@hookimpl
def labcrane_estimates():
    return [offer("step", StepSettings, Step)]
'''


@pytest.mark.long
@pytest.mark.timeout(600)
@needs("Xvfb", "gcc")
def test_each_step_is_in_a_picture_within_a_quarter_second_and_the_record_says_when(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = unique("amplifier")
    lab = Lab(tmp_path, build(tmp_path))
    protocol = tmp_path / "study.yaml"
    protocol.write_text(STUDY.replace("DEVICE", name))
    (tmp_path / "plugins").mkdir()
    (tmp_path / "plugins" / "step.py").write_text(PLUGIN)
    with an_x_server() as display:
        monkeypatch.setenv("DISPLAY", display)
        lab.device(name, Skew(), rate=RATE_HZ, size=CHUNK)
        words = ("--participant", "P001", "--simulate", "--feedback", "--data", tmp_path / "data")
        run = labcrane("run", protocol, *words)
        lab.processes.append(run)
        try:
            said = run.communicate(timeout=550)[0]
            assert run.returncode == 0, said
        finally:
            lab.close()
    session = open_recording(tmp_path / "data" / "P001-SIMULATED" / "P001-SIMULATED.h5").session(1)
    pictures = session.streams["labcrane.feedback.screen"]
    shown = pictures.data[pictures.data["cue.ball.opacity"].notna()]
    changed = shown["cue.ball.opacity"].diff().abs() > 0.4
    steps = shown[changed]
    assert len(steps) >= 200
    ticks = session.streams["input"].data.iloc[steps["frame.tick"].astype(int)]
    true = ticks["estimate.step.sampled"].to_numpy()
    stated = ticks["estimate.step.time"].to_numpy()
    assert np.abs(stated - true).max() <= 0.005
    began = true // STEP_S * STEP_S
    seen = pictures.time[np.flatnonzero(pictures.data["cue.ball.opacity"].notna())[changed]]
    late = seen - began
    assert late.min() > 0.0
    assert np.quantile(late, 0.99) <= 0.25 + WINDOW_S
