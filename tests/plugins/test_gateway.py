"""A control station behind the open gateway protocol."""

import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path

import numpy as np
import pylsl
import pytest
from cranes import needs_bullet
from dmd_arms import with_files
from rehearsal import NoLog, ScriptedConsole, loaded

from labcrane import FloatArray, InputDevice, Run, Tick
from labcrane.core.clock import SystemClock
from labcrane.protocol.rig import Rig
from labcrane.session import loop
from labcrane.session.sequencer import Sequencer
from labcrane.testing import Command, InputContract, Order, ch8, make_frame, make_run, plan_session
from labcrane_gateway.settings import GatewaySettings
from labcrane_gateway.station import Station

TESTS = Path(__file__).parents[1]


class TestStation(InputContract):  # "gateway"
    @pytest.fixture
    def device(self) -> InputDevice:
        return Station(GatewaySettings(stream="nobody.sends"), ch8())


STUDY = """\
labcrane: 1
study: gateway
title: A gateway
machine: ied_arm.yaml
input: {use: gateway}
scheme: {use: valve}
dynamics:
  use: dmd_arm
  model: arm.dmd.yaml
  proportional: [base]
  scenes: [scenes/touch.yaml]
tasks: {reach: {use: scenario, scenes: [scenes/touch.yaml]}}
sessions: [{name: only, steps: [{block: {task: reach}}]}]
"""


@pytest.mark.slow
@needs_bullet
def test_a_program_written_from_the_documentation_drives_the_arm(tmp_path: Path) -> None:
    (with_files(tmp_path) / "study.yaml").write_text(STUDY, encoding="utf-8")
    study = loaded(tmp_path / "study.yaml")
    plan = plan_session(study, "P001", 1)
    rig = Rig.build(study, simulated=False)
    console, seen = DrivenByAProgram(), []
    try:
        with rig.opened(study, plan.seed) as run:
            arm = run.state.index("joint.angle.arm")
            signal = run.command.find("valve.signal")
            sequencer = Sequencer(study, plan, rig, waits=False)

            def keep(frame):
                moved = frame.state[arm], frame.command[signal].tolist()
                seen.append((frame.tick.woke, frame.paused, *moved, frame.events))
                console.happened += [event.name for event in frame.events]

            loop.run(rig, run, sequencer, SystemClock(), console, NoLog(), [keep])
        output, _ = console.program.communicate(timeout=240)
    finally:
        console.program.kill()
        console.program.communicate()
    driven = [each for each in seen if each[3] == [0.0, 120.0, 0.0, 0.0]]
    assert driven[-1][0] - driven[0][0] > 3.0
    # About 1.7 deg/s. A busy computer may hold the program up: the arm is placed anew then.
    assert max(each[2] for each in driven) - driven[0][2] > np.radians(4)
    assert float(output) == pytest.approx(120.0, abs=0.5)  # it was told of the valve's opening
    names = [event.name for each in seen for event in each[4]]
    lost, back = names.index("input.lost"), names.index("input.back")
    assert lost < back < len(names) - 1 - names[::-1].index("input.lost")
    assert seen[-1][1]
    assert seen[-1][3] == [0.0] * 4


class DrivenByAProgram(ScriptedConsole):
    """Starts the program once input is missed, and ends when it is missed after the program."""

    def __init__(self) -> None:
        super().__init__()
        self.program: subprocess.Popen | None = None
        self.happened: list[str] = []

    def commands(self) -> list[Command]:
        super().commands()
        states = [name for name in self.happened if name in ("input.lost", "input.back")]
        if self.program is None and states:
            self.program = subprocess.Popen(
                [sys.executable, str(TESTS / "helpers" / "gateway_program.py"), "7"],
                stdout=subprocess.PIPE,
                encoding="utf-8",
            )
        gone = self.program is not None and self.program.poll() is not None
        ends = (gone and states[-1] == "input.lost") or self._tick > 240 * 90
        return [Command(Order.END)] if ends else []


def station_outlet(name: str, labels: Sequence[str]) -> pylsl.StreamOutlet:
    info = pylsl.StreamInfo(name, "Control", len(labels), 0.0, "float32", name)
    channels = info.desc().append_child("channels")
    for label in labels:
        channels.append_child("channel").append_child_value("label", label)
    return pylsl.StreamOutlet(info)


def heard(
    device: Station,
    run: Run,
    outlet: pylsl.StreamOutlet,
    sample: Sequence[float],
    enough: Callable[[], bool],
) -> FloatArray:
    """Send a sample again and again until it is enough; return the last axes."""
    end = time.perf_counter() + 240.0
    while True:
        outlet.push_sample(list(sample))
        time.sleep(0.02)
        now = time.perf_counter()
        axes = device.read(Tick(1, now, now), make_frame(run))
        if enough() or now > end:
            return axes


@pytest.mark.parametrize(
    ("labels", "sample", "complaint"),
    [
        (("base",), [0.0], "its channels are base; the machine also needs slew, shoulder, elbow"),
        (ch8().names, [0.0, 400.0, 0.0, 0.0], "refused, because 400 is not within -250 to 250"),
        (ch8().names, [0.0, np.nan, 0.0, 0.0], "refused, because nan is not within -250 to 250"),
    ],
)
def test_what_is_wrong_with_a_station_is_told(labels, sample, complaint: str) -> None:
    name = f"wrong.{len(labels)}.{sample[-3:][0]}"
    outlet = station_outlet(name, labels)
    device = Station(GatewaySettings(stream=name), ch8())
    run = make_run(ch8(), axes=device.signals)
    device.open(run)
    with closing(device):
        axes = heard(device, run, outlet, sample, lambda: complaint in (device.fault or ""))
        assert complaint in (device.fault or "")
        assert not axes.any()
