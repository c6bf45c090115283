"""A control station behind the open gateway protocol."""

import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pylsl
import pytest
from cranes import needs_bullet
from dmd_arms import with_files
from gone_stream import goes_once
from rehearsal import NoLog, ScriptedConsole

from labcrane import FloatArray, InputDevice, Run, Tick
from labcrane.core.clock import SystemClock
from labcrane.design.plan import plan_session
from labcrane.protocol.rig import Rig
from labcrane.protocol.study import load
from labcrane.registry.registry import discover
from labcrane.session import loop
from labcrane.session.commands import Command, Order
from labcrane.session.sequencer import Sequencer
from labcrane.testing import InputContract, ch8, make_frame, make_run
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
    study = load(tmp_path / "study.yaml", discover())
    plan = plan_session(study, "P001", 1)
    rig = Rig.build(study, simulated=False)
    program = subprocess.Popen(
        [sys.executable, str(TESTS / "helpers" / "gateway_program.py"), "7"],
        stdout=subprocess.PIPE,
        encoding="utf-8",
    )
    seen = []
    try:
        with rig.opened(study, plan.seed) as run:
            arm = run.state.index("joint.angle.arm")
            signal = run.command.find("valve.signal")
            sequencer = Sequencer(study, plan, rig, waits=False)

            def keep(frame):
                moved = frame.state[arm], frame.command[signal].tolist()
                seen.append((frame.tick.woke, frame.paused, *moved, frame.events))

            console = EndsWhenLostTwice(seen)
            loop.run(rig, run, sequencer, SystemClock(), console, NoLog(), [keep])
        output, _ = program.communicate(timeout=240)
    finally:
        program.kill()
        program.communicate()
    driven = [each for each in seen if each[3] == [0.0, 120.0, 0.0, 0.0]]
    assert driven[-1][0] - driven[0][0] > 3.0
    assert driven[-1][2] - driven[0][2] > np.radians(5)  # about 1.7 deg/s
    assert float(output) == pytest.approx(120.0, abs=0.5)  # it was told of the valve's opening
    names = [event.name for each in seen for event in each[4]]
    assert names.index("input.back") < len(names) - 1
    assert names.count("input.lost") == 2  # before it was there, and after it had gone
    assert seen[-1][1]
    assert seen[-1][3] == [0.0] * 4


class EndsWhenLostTwice(ScriptedConsole):
    """Ends the session once the program has come and gone, and a while later at the latest."""

    def __init__(self, seen: Sequence[tuple]) -> None:
        super().__init__()
        self._seen, self._lost, self._read = seen, 0, 0

    def commands(self) -> list[Command]:
        news, self._read = self._seen[self._read :], len(self._seen)
        self._lost += sum(event.name == "input.lost" for each in news for event in each[4])
        return [Command(Order.END)] if self._lost == 2 or self._read > 240 * 90 else []


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
    try:
        axes = heard(device, run, outlet, sample, lambda: complaint in (device.fault or ""))
        assert complaint in (device.fault or "")
        assert not axes.any()
    finally:
        device.close()


def test_a_station_that_goes_while_it_is_found_is_found_again(monkeypatch) -> None:
    goes_once(monkeypatch)
    outlet = station_outlet("gone.once", ch8().names)
    device = Station(GatewaySettings(stream="gone.once"), ch8())
    run = make_run(ch8(), axes=device.signals)
    device.open(run)
    try:
        axes = heard(device, run, outlet, [0.0, 125.0, 0.0, 0.0], lambda: device.fault is None)
        assert axes.tolist() == [0.0, 0.5, 0.0, 0.0, 1.0]
    finally:
        device.close()
