"""Views and sounds that are killed, hang or raise: the session goes on as if nothing had been."""

import os
import signal
import subprocess
from pathlib import Path

import numpy as np
import psutil
import pytest
from faults.sessions import kill_all, labcrane, unique, wait_for

import labcrane as lab
from labcrane.recording.recording import SessionRecord

STUDY = """\
labcrane: 1
study: {study}
title: A study whose feedback fails
rate_hz: 240
machine: ch8
input: {{use: dual_joystick}}
scheme:
  use: joint_velocity
  map: {{slew: left.x, elbow: left.y, wrist: right.x, shoulder: -right.y}}
dynamics: {{use: kinematic_crane}}
tasks:
  aiming: {{use: aiming, distances: [2], movements: 1, limit_s: 0.5}}
feedback:
  ball: {{use: sphere}}
views:
  killed: {{use: view, display: hidden, renderer: software, size: [160, 90], rate_hz: 30}}
  hanging: {{use: view, display: hidden, renderer: software, size: [160, 90], rate_hz: 30}}
  raising: {{use: raising, once: {marker}}}
sessions:
  - name: only
    steps:
      - block: {{task: aiming}}
      - break: {{seconds: 4}}
      - block: {{task: aiming, feedback: none}}
      - break: {{seconds: 8}}
      - block: {{task: aiming}}
"""

PLUGIN = '''
from pathlib import Path
import numpy as np
from labcrane import Feedback, Settings, Signal, hookimpl, offer


class RaisingSettings(Settings):
    once: str
    """A file that says it has been done."""


class Raising(Feedback):
    signals = (Signal("seen", "1"),)

    def __init__(self, settings):
        self._once, self._seen = Path(settings.once), 0

    def present(self, frame):
        self._seen += 1
        if self._seen == 100 and not self._once.exists():
            self._once.touch()
            raise ValueError("a mistake in a plugin")
        return np.array([float(self._seen)])


@hookimpl
def labcrane_feedback():
    return [offer("raising", RaisingSettings, lambda settings, machine: Raising(settings))]
'''


def install(folder: Path) -> dict[str, str]:
    """Return an environment in which a plugin that raises is installed."""
    (folder / "raising_plugin.py").write_text(PLUGIN)
    about = folder / "raising_plugin-1.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: raising-plugin\nVersion: 1\n")
    (about / "entry_points.txt").write_text("[labcrane]\nraising = raising_plugin\n")
    return {**os.environ, "PYTHONPATH": str(folder)}


def hosts(launcher: "subprocess.Popen[str]") -> list[psutil.Process]:
    found = psutil.Process(launcher.pid).children()
    return [child for child in found if "labcrane.feedback_host" in child.cmdline()]


@pytest.fixture
def protocol(tmp_path: Path) -> Path:
    path = tmp_path / "study.yaml"
    path.write_text(STUDY.format(study=unique("feedback"), marker=tmp_path / "raised"))
    return path


def test_killed_hanging_and_raising_feedback_leave_the_session_as_it_is(
    protocol: Path, tmp_path: Path
) -> None:
    data = tmp_path / "data"
    arguments = ["--participant", "P001", "--simulate", "--feedback", "--data", data]
    environment = install(tmp_path)
    launcher = labcrane("run", protocol, *arguments, env=environment)
    try:
        journal = data / "P001-SIMULATED" / "ses-01_run.xdf"
        wait_for(journal.exists, patience_s=60)
        wait_for(lambda: journal.stat().st_size > 1_000_000, patience_s=60)
        first, second = sorted(hosts(launcher), key=lambda host: (host.create_time(), host.pid))[:2]
        first.send_signal(signal.SIGKILL)
        second.send_signal(signal.SIGSTOP)
        said, _ = launcher.communicate(timeout=120)
    finally:
        if launcher.poll() is None:
            kill_all(launcher)
    assert launcher.returncode == 0, said
    session = lab.open_recording(data / "P001-SIMULATED" / "P001-SIMULATED.h5").session(1)
    events = session.events
    lost = events[events["name"] == "feedback.lost"]
    why = {data["what"]: data["why"] for data in lost["data"]}
    assert set(why) == {"killed", "hanging", "raising"}
    assert "its process ended with exit code -9" in why["killed"]
    assert "it has not been heard of for" in why["hanging"]
    assert "ValueError: a mistake in a plugin" in why["raising"]

    loop = session.streams["loop"].data
    np.testing.assert_array_equal(np.diff(loop["tick"]), 1.0)  # not one tick is missing
    assert events["name"].tolist().count("pause.start") == 0
    assert session.trials["outcome"].isin(["success", "timeout"]).all()
    lateness = (loop["woke"] - loop["due"]).to_numpy()
    troubled = (loop["due"] > lost["time"].min() - 1) & (loop["due"] < lost["time"].max() + 3)
    difference = np.median(lateness[troubled]) - np.median(lateness[~troubled])
    assert abs(difference) < 0.0005

    for name in ("killed", "hanging", "raising"):
        shown = session.streams[f"labcrane.feedback.{name}"].data
        assert shown["frame.tick"].max() > loop["tick"].max() - 240  # it went on to the end
        assert (np.diff(shown["frame.tick"]) >= 0).all()
    what_was_shown_can_be_rebuilt(session)


def what_was_shown_can_be_rebuilt(session: SessionRecord) -> None:
    """Compute the sphere again from the recorded frames, by the tick that each picture shows."""
    shown = session.streams["labcrane.feedback.hanging"].data
    assert session.trials["feedback"].tolist() == ["ball"] * 2 + ["none"] * 2 + ["ball"] * 2
    tick = shown["frame.tick"].to_numpy(int)
    state, task = session.streams["state"].data, session.streams["task"].data
    axes = [f"position.{axis}" for axis in "xyz"]
    tip = state[[f"tip.{axis}" for axis in axes]].to_numpy()[tick]
    target = task[[f"target.{axis}" for axis in axes]].to_numpy()[tick]
    distance = np.linalg.norm(tip - target, axis=1)
    radius = 0.15 + 0.45 * np.minimum(distance / 4.0, 1.0)  # the cue's law, written out again
    recorded = shown["cue.ball.radius"].to_numpy()
    drawn = np.isfinite(recorded)
    assert drawn.sum() > 10
    np.testing.assert_allclose(recorded[drawn], radius[drawn], atol=1e-12)
    without = session.events.query("name == 'block.start'").iloc[1]["time"]
    again = session.events.query("name == 'block.start'").iloc[2]["time"]
    silent = (shown["frame.due"] > without + 0.1) & (shown["frame.due"] < again)
    assert not drawn[silent].any()
