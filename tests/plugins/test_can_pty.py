"""A panel process on the other side of a pty: straight into a session, and through the gateway."""

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from cranes import needs_bullet
from rehearsal import NoLog, ScriptedConsole

from labcrane.core.clock import SystemClock
from labcrane.design.plan import plan_session
from labcrane.protocol.rig import Rig
from labcrane.protocol.study import load
from labcrane.registry.registry import discover
from labcrane.session import loop
from labcrane.session.commands import Command, Order
from labcrane.session.sequencer import Sequencer

pytestmark = needs_bullet

RETRIEVAL = Path(__file__).parents[2] / "protocols" / "retrieval"

PROTOCOL = """\
labcrane: 1
study: panel
title: A panel on a pty
machine: {machine}
input: {input}
scheme: {{use: valve}}
dynamics:
  use: dmd_arm
  model: {folder}/arm.dmd.yaml
  proportional: [base]
  jaws: {{}}
  scenes: [{scene}]
tasks: {{reach: {{use: scenario, scenes: [{scene}], limit_s: 600}}}}
sessions: [{{name: only, steps: [{{block: {{task: reach}}}}]}}]
"""


@pytest.fixture(params=[(10, 4, 6), pytest.param((60, 30, 33), marks=pytest.mark.long)])
def panel(request, tmp_path: Path) -> Iterator[tuple[Path, int, subprocess.Popen[str]]]:
    """A panel that sends for some seconds, and is unplugged from one of them to another."""
    link = tmp_path / "ttyPANEL"
    program = Path(__file__).parents[1] / "can_panel.py"
    process = subprocess.Popen(
        [sys.executable, str(program), str(link), "100", *map(str, request.param)],
        stdout=subprocess.PIPE,
        encoding="utf-8",
    )
    try:
        assert process.stdout
        assert process.stdout.readline() == "ready\n"
        yield link, request.param[0], process
    finally:
        process.kill()
        process.communicate()


class PanelConsole(ScriptedConsole):
    """Ends the session when the panel has ended, however long it took on a busy computer."""

    def __init__(self, panel: subprocess.Popen[str]) -> None:
        super().__init__({240 * 240: [Command(Order.END)]})
        self._panel: subprocess.Popen[str] | None = panel

    def commands(self) -> list[Command]:
        if self._panel is None or self._panel.poll() is None:
            return super().commands()
        self._panel = None
        return [Command(Order.END)]


def session(folder: Path, controls: str, panel: subprocess.Popen[str]) -> list:
    """Run a session in real time; return when ticks woke, commands, pauses and events."""
    scene = RETRIEVAL / "scenes" / "touch.yaml"
    text = PROTOCOL.format(input=controls, folder=RETRIEVAL, machine="ied_arm.yaml", scene=scene)
    (folder / "study.yaml").write_text(text, encoding="utf-8")
    (folder / "ied_arm.yaml").write_text(
        (RETRIEVAL / "ied_arm.yaml").read_text(encoding="utf-8"), encoding="utf-8"
    )
    study = load(folder / "study.yaml", discover())
    plan = plan_session(study, "P001", 1)
    rig = Rig.build(study, simulated=False)
    frames = []
    with rig.opened(study, plan.seed) as run:
        signal = run.command.find("valve.signal")

        def keep(frame):
            command = frame.command[signal].copy()
            frames.append((frame.tick.woke, command, frame.paused, frame.events))

        course = Sequencer(study, plan, rig, waits=False)
        console = PanelConsole(panel)
        loop.run(rig, run, course, SystemClock(), console, NoLog(), [keep])
    return frames


def told(process: subprocess.Popen[str]) -> dict[str, str]:
    output, _ = process.communicate(timeout=240)
    return dict(line.split(" ", 1) for line in output.splitlines() if " " in line)


def test_a_panel_process_unplugged_in_the_middle_pauses_the_session_and_resumes_it(
    panel, tmp_path: Path
) -> None:
    link, _, process = panel
    valves = "{base: 1, arm: 2, boom: 3, jaws: 4}"
    # A stall of a busy computer is not to be the loss: silence counts after a long time only.
    controls = f"{{use: can, bus: 'slcan:{link}', valves: {valves}, timeout_s: 1.5}}"
    frames = session(tmp_path, controls, process)
    said = told(process)
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
    after = np.array([command for woke, command, _, _ in frames if woke > found + 0.1])
    assert np.abs(before).max() > 190
    assert np.abs(after).max() > 190
    sent, heard = map(int, said["sent"].split())
    assert sent > 0
    assert heard > 0  # estimated and measured flow came back to the panel
    assert_told_of_the_flow(said)


@pytest.mark.parametrize("panel", [(8, 3, 5)], indirect=True)
def test_the_gateway_bridges_a_panel_to_a_session_over_lsl_and_the_flow_back(
    panel, tmp_path: Path
) -> None:
    link, seconds, process = panel
    words = [sys.executable, "-m", "labcrane", "gateway", "can", "--bus", f"slcan:{link}"]
    for valve in ("jaws=4", "base=1", "boom=3", "arm=2"):  # in no order of the machine
        words += ["--valve", valve]
    words += ["--name", "bridged.command", "--seconds", str(seconds + 2)]
    bridge = subprocess.Popen(words, stdout=subprocess.PIPE, encoding="utf-8")
    try:
        assert process.stdout.readline() == "open\n"
        frames = session(tmp_path, "{use: gateway, stream: bridged.command}", process)
        said = told(process)
        spoken, _ = bridge.communicate(timeout=240)
    finally:
        bridge.kill()
        bridge.communicate()
    unplugged, back = float(said["unplugged"]), float(said["back"])
    assert "the panel is there" in spoken[spoken.index("is gone") :]
    moving = [woke for woke, command, _, _ in frames if command.any()]
    before = [woke for woke in moving if woke < unplugged + 1.0]
    # 0.25 s after the last sample, which may be one step of the bridge behind the plug.
    assert unplugged < before[-1] < unplugged + 0.25 + 0.1
    assert before[-1] - before[0] > 1.0
    assert moving[-1] > back
    asked = np.abs([command for _, command, _, _ in frames]).max(axis=0)
    np.testing.assert_allclose(asked, [200, 100, 67, 50], atol=4)
    assert_told_of_the_flow(said)
    lost = [event for _, _, _, events in frames for event in events if event.name == "input.lost"]
    assert "no command in stream 'bridged.command' for 0.25 s" in str(lost[-1].data["why"])


def assert_told_of_the_flow(said: dict[str, str]) -> None:
    """Each valve's own: its largest signal in percent, which lags and dead times hardly change."""
    np.testing.assert_allclose([*map(float, said["told"].split())], [80, 40, 27, 20], atol=5)
