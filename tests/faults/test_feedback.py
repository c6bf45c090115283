"""Views and sounds that are killed, hang or raise: the session goes on as if nothing had been."""

import signal
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import psutil
import pytest
from faults.sessions import unique, wait_for
from needs import GRAPHICS, needs
from simple_crane import FORM

import labcrane as lab
from labcrane.core import Event
from labcrane.launcher.launcher import Launcher
from labcrane.recording import SessionRecord
from labcrane.session.visit import visit_of
from labcrane.testing import Command, Order, QueueConsole

STUDY = (
    """\
labcrane: 1
study: {study}
title: A study whose feedback fails
rate_hz: 240
"""
    + FORM
    + """\
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
      - break: {{seconds: 900}}
      - block: {{task: aiming, feedback: none}}
      - break: {{seconds: 900}}
      - block: {{task: aiming}}
"""
)

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
    return [offer("raising", RaisingSettings, Raising)]
'''


def install(folder: Path, name: str = "raising", plugin: str = PLUGIN) -> None:
    """Install a plugin, such as one that raises, for those who look for modules in ``folder``."""
    (folder / f"{name}_plugin.py").write_text(plugin)
    about = folder / f"{name}_plugin-1.dist-info"
    about.mkdir()
    (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}-plugin\nVersion: 1\n")
    (about / "entry_points.txt").write_text(f"[labcrane]\n{name} = {name}_plugin\n")


def hosts() -> list[psutil.Process]:
    """Return the feedback processes of this process's session, oldest first."""
    found = [child for child in psutil.Process().children() if runs_feedback(child)]
    return sorted(found, key=lambda host: (host.create_time(), host.pid))


def runs_feedback(process: psutil.Process) -> bool:
    try:
        return "labcrane.feedback.process" in process.cmdline()
    except psutil.NoSuchProcess:  # the one that raises has just ended
        return False


@pytest.fixture
def protocol(tmp_path: Path) -> Path:
    path = tmp_path / "study.yaml"
    path.write_text(STUDY.format(study=unique("feedback"), marker=tmp_path / "raised"))
    return path


class Told:
    """What a session has told of itself so far."""

    def __init__(self, console: QueueConsole) -> None:
        self._events: list[Event] = []
        console.listeners.append(self._events.append)

    def count(self, name: str) -> int:
        return sum(event.name == name for event in self._events)

    def back(self) -> set[str]:
        """Return what feedback was lost and presents again."""
        lost: dict[str, bool] = {}
        for event in list(self._events):
            if event.name == "feedback.lost":
                lost[event.data["what"]] = False
            elif event.name == "feedback.ready" and event.data["what"] in lost:
                lost[event.data["what"]] = True
        return {name for name, ready in lost.items() if ready}


@pytest.mark.slow
@needs(*GRAPHICS)
def test_killed_hanging_and_raising_feedback_leave_the_session_as_it_is(
    protocol: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    install(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    data, console, said = tmp_path / "data", QueueConsole(), []
    told = Told(console)
    order = visit_of(protocol, "P001", 1, data, simulated=True, feedback=True)
    with ThreadPoolExecutor(1) as elsewhere:
        outcome = elsewhere.submit(Launcher(order, console, said.append).run)
        try:
            wait_for(lambda: told.count("block.end") == 1, patience_s=240)
            first, second = hosts()[:2]
            first.send_signal(signal.SIGKILL)
            second.send_signal(signal.SIGSTOP)
            wait_for(lambda: told.count("feedback.lost") >= 3, patience_s=240)
            console.give(Command(Order.SKIP))
            wait_for(lambda: told.back() == {"killed", "hanging", "raising"}, patience_s=240)
            wait_for(lambda: told.count("break.start") == 2, patience_s=240)
            console.give(Command(Order.SKIP))
        except BaseException:
            console.give(Command(Order.END))
            raise
    assert outcome.result().died is None, said
    session = lab.open_recording(data / "P001-SIMULATED" / "P001-SIMULATED.h5").session(1)
    events = session.events
    lost = events[events["name"] == "feedback.lost"]
    why: dict[str, list[str]] = {}
    for data in lost["data"]:  # a busy computer may keep one of them silent as well
        why.setdefault(data["what"], []).append(data["why"])
    for name, reason in {
        "killed": "its process ended with exit code -9",
        "hanging": "it has not responded for",
        "raising": "ValueError: a mistake in a plugin",
    }.items():
        assert any(reason in each for each in why.pop(name))
    assert not why

    loop = session.streams["loop"].data
    np.testing.assert_array_equal(np.diff(loop["tick"]), 1.0)  # not one tick is missing
    assert events["name"].tolist().count("pause.start") == 0
    assert session.trials["outcome"].isin(["success", "timeout"]).all()

    first_trial = loop.loc[loop["due"] >= session.trials["started"].min(), "tick"].iloc[0]
    for name in ("killed", "hanging", "raising"):
        shown = session.streams[f"labcrane.feedback.{name}"].data
        assert shown["frame.tick"].iloc[0] < first_trial  # nobody begins without feedback
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
