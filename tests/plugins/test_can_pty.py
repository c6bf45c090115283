"""A panel process on the other side of a pty: unplugged in a session, and back."""

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from cranes import needs_bullet
from dmd_arms import with_files
from rehearsal import NoLog, ScriptedConsole, loaded

from labcrane import Frame
from labcrane.core.clock import SystemClock
from labcrane.protocol.rig import Rig
from labcrane.session import loop
from labcrane.session.sequencer import Sequencer
from labcrane.testing import Command, Order, plan_session

pytestmark = needs_bullet

RATE_HZ = 240

PROTOCOL = """\
labcrane: 1
study: panel
title: A panel on a pty
rate_hz: 240
machine: ied_arm.yaml
input: {input}
scheme: {{use: valve}}
dynamics:
  use: dmd_arm
  model: arm.dmd.yaml
  proportional: [base]
  jaws: {{}}
  scenes: [scenes/touch.yaml]
tasks: {{reach: {{use: scenario, scenes: [scenes/touch.yaml], limit_s: 600}}}}
sessions: [{{name: only, steps: [{{block: {{task: reach}}}}]}}]
"""


SWING = (200, 100, 67, 50)
"""How far the panel's levers go, of its four valves."""


class Panel:
    """A panel that swings its levers for some seconds, is unplugged, and swings them again.

    What it does next is told to it when the session has seen enough, however slow the computer.
    """

    def __init__(self, link: Path, swung_s: float, away_s: float) -> None:
        program = Path(__file__).parents[1] / "helpers" / "can_panel.py"
        self.link = link
        self.process = subprocess.Popen(
            [sys.executable, str(program), str(link), "100", str(away_s)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            encoding="utf-8",
        )
        self._swung_s = swung_s
        self._words = ["unplug", "end"]
        self._seen: list[np.ndarray] = []

    def watch(self, frame: Frame, command: np.ndarray) -> None:
        """Take what reached the session in a tick."""
        if any(event.name == "input.lost" for event in frame.events):
            self._seen.clear()
        if command.any():
            self._seen.append(command)
        enough = len(self._seen) > self._swung_s * RATE_HZ
        if self._words and enough and (self.farthest() >= 0.97 * np.array(SWING)).all():
            self.tell(self._words.pop(0))
            self._seen.clear()

    def farthest(self) -> np.ndarray:
        """Return how far each lever was seen to go, but in the last second: flow lags behind."""
        return np.abs(self._seen[:-RATE_HZ]).max(axis=0, initial=0.0)

    def tell(self, word: str) -> None:
        assert self.process.stdin
        self.process.stdin.write(word + "\n")
        self.process.stdin.flush()

    def heard(self) -> dict[str, str]:
        """Return what it says at its end, by the first word."""
        output, _ = self.process.communicate(timeout=240)
        return dict(line.split(" ", 1) for line in output.splitlines() if " " in line)


@pytest.fixture(params=[(2, 2), pytest.param((27, 3), marks=pytest.mark.long)])
def panel(request, tmp_path: Path) -> Iterator[Panel]:
    """A panel that swings for so many seconds at least, and is away for so many in between."""
    panel = Panel(tmp_path / "ttyPANEL", *request.param)
    try:
        assert panel.process.stdout
        assert panel.process.stdout.readline() == "ready\n"
        yield panel
    finally:
        panel.process.kill()
        panel.process.communicate()


class PanelConsole(ScriptedConsole):
    """Ends the session when the panel has ended, however long it took on a busy computer."""

    def __init__(self, panel: Panel) -> None:
        super().__init__({240 * RATE_HZ: [Command(Order.END)]})
        self._panel: Panel | None = panel

    def commands(self) -> list[Command]:
        if self._panel is None or self._panel.process.poll() is None:
            return super().commands()
        self._panel = None
        return [Command(Order.END)]


def session(folder: Path, controls: str, panel: Panel) -> list:
    """Run a session in real time; return when ticks woke, commands, pauses and events."""
    text = PROTOCOL.format(input=controls)
    (with_files(folder) / "study.yaml").write_text(text, encoding="utf-8")
    study = loaded(folder / "study.yaml")
    plan = plan_session(study, "P001", 1)
    rig = Rig.build(study, simulated=False)
    frames = []
    with rig.opened(study, plan.seed) as run:
        asked = run.command.find("valve.signal")

        def keep(frame: Frame) -> None:
            command = frame.command[asked].copy()
            frames.append((frame.tick.woke, command, frame.paused, frame.events))
            panel.watch(frame, command)

        sequencer = Sequencer(study, plan, rig, waits=False)
        loop.run(rig, run, sequencer, SystemClock(), PanelConsole(panel), NoLog(), [keep])
    return frames


@pytest.mark.slow
def test_a_panel_process_unplugged_in_the_middle_pauses_the_session_and_resumes_it(
    panel: Panel, tmp_path: Path
) -> None:
    valves = "{base: 1, arm: 2, boom: 3, jaws: 4}"
    # A stall of a busy computer is not to be the loss: silence counts after a long time only.
    controls = f"{{use: can, bus: 'slcan:{panel.link}', valves: {valves}, timeout_s: 1.5}}"
    frames = session(tmp_path, controls, panel)
    said = panel.heard()
    unplugged, back = float(said["unplugged"]), float(said["back"])
    events = [(woke, event) for woke, _, _, events in frames for event in events]
    # A busy computer begins before the panel and ends after it, which are losses too.
    lost, why = next(
        (woke, event.data["why"])
        for woke, event in events
        if event.name == "input.lost" and woke > unplugged
    )
    found = next(woke for woke, event in events if event.name == "input.back" and woke > lost)
    assert "is gone" in str(why)
    assert found > back
    for woke, command, paused, _ in frames:
        if lost <= woke < found:
            assert paused
            assert not command.any()
    before = np.array([command for woke, command, _, _ in frames if woke < unplugged])
    after = np.array([command for woke, command, _, _ in frames if woke > found])
    np.testing.assert_allclose(np.abs(before).max(axis=0), SWING, atol=4)
    np.testing.assert_allclose(np.abs(after).max(axis=0), SWING, atol=4)
    sent, heard = map(int, said["sent"].split())
    assert sent > 0
    assert heard > 0  # estimated and measured flow came back to the panel
    assert_told_of_the_flow(said)


def assert_told_of_the_flow(said: dict[str, str]) -> None:
    """Each valve's own: its largest signal in percent, which lags and dead times hardly change."""
    np.testing.assert_allclose([*map(float, said["told"].split())], [80, 40, 27, 20], atol=5)
