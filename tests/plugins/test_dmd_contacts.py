"""Mistakes of a driven arm: what it really touches, and what a run makes of it."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cranes import needs_bullet
from dmd_arms import with_files
from rehearsal import Rehearsal, loaded, rehearse

from labcrane import FloatArray, Frame, InputDevice, Run, Signal, Tick
from labcrane.core import Phase
from labcrane.machines import load_machine, reach
from labcrane.protocol.rig import Rig
from labcrane.testing import Command, Order

pytestmark = needs_bullet

RETRIEVAL = Path(__file__).parents[2] / "protocols" / "retrieval"
MACHINE = load_machine("ied_arm.yaml", RETRIEVAL)
RATE_HZ = 240.0
STUDY = """\
labcrane: 1
study: contacts
title: Pushes
machine: ied_arm.yaml
input: {use: gateway}
operator: {use: scenario_operator}
scheme: {use: valve}
dynamics:
  use: dmd_arm
  model: arm.dmd.yaml
  proportional: [base]
  proportional_valve: {dead_band: 0, dead_time_s: 0, lag_s: 0}
  scenes: [scene.yaml]
tasks: {push: {use: scenario, scenes: [scene.yaml], mistakes: 4}}
sessions: [{name: only, steps: [{block: {task: push}}]}]
"""
SCENE = """\
labcrane_scene: 1
title: something to push at
things: {{{things}}}
goals: [{{position: [1.44, -0.75, 0.15], radius: 0.15}}]
start_deg: [{start}]
limit_s: 60
"""
MASS_KG, FRICTION, LIMIT_N = 40.0, 0.6, 100.0
BLOCK = (
    "block: {shape: cylinder, size: [0.3, 0.3, 0.3], position: [1.5, 0.35, 0.1501], "
    f"mass_kg: {MASS_KG}, friction: {FRICTION}, limit_n: {LIMIT_N}}}"
)
"""Round, so that whatever touches its side pushes through its centre."""
ABOVE_AND_BELOW = (
    "below: {shape: box, size: [0.3, 0.3, 0.05], position: [1.6, 0, 0.025], fixed: true}, "
    "above: {shape: box, size: [0.3, 0.3, 0.05], position: [1.6, 0, 0.69], fixed: true}"
)

Script = Iterator[Mapping[str, float]]


class Hand(InputDevice):
    """Opens valves as a script says, which sees the frame before; ``yield`` is a tick."""

    def __init__(self) -> None:
        self.signals = (Signal("valve", "1", MACHINE.names),)

    def script(self) -> Script:
        raise NotImplementedError

    def open(self, run: Run) -> None:
        self.run, self._steps = run, self.script()

    def sees(self, column: str) -> float:
        return self.seen.state.item(self.run.state.index(column))

    def read(self, tick: Tick, seen: Frame) -> FloatArray:
        self.seen = seen
        asked = next(self._steps, {}) if seen.phase is Phase.RUNNING else {}
        return np.array([asked.get(name, 0.0) for name in MACHINE.names])


class Pusher(Hand):
    """Slews against the block and pushes it aside in jerks, then lets go of it; several times."""

    def __init__(self, pushes: int) -> None:
        super().__init__()
        self._pushes = pushes

    def script(self) -> Script:
        for _ in range(self._pushes):
            while self.sees("scene.block.force.block") == 0.0:
                yield {"base": 0.2}
            for tick in range(round(0.8 * RATE_HZ)):
                # Each stop is shorter than the time for which an episode must be quiet to end.
                yield {"base": 0.1 if tick % 60 < 36 else 0.0}
            for _ in range(round(0.5 * RATE_HZ)):
                yield {"base": -0.1}
        while True:
            yield {"base": -0.5}  # to the goal, which is on the other side


class Presser(Hand):
    """Drives the boom's tip against what is below and above it: 1 is down, -1 is up."""

    def __init__(self, ways: Sequence[int]) -> None:
        super().__init__()
        self._ways = ways

    def script(self) -> Script:
        for way in self._ways:
            while self.sees("joint.overload.arm") != way:
                yield {"arm": 0.5 * way}
            for _ in range(round(0.5 * RATE_HZ)):
                yield {"arm": 0.5 * way}
        for _ in range(round(0.5 * RATE_HZ)):  # off again, so that the slewing is free
            yield {"arm": -0.5 * self._ways[-1]}
        while True:
            yield {"base": -0.5}


def start_at(height: float) -> str:
    found = reach(MACHINE, (1.6, 0.0, height))
    assert found is not None
    return ", ".join(f"{math.degrees(angle):.3f}" for angle in (*found[:3], 0.0))


def run_of(
    folder: Path, hand: Hand, things: str, orders: Mapping[int, list[Command]] | None = None
) -> Rehearsal:
    height = 0.15 if things is BLOCK else 0.27
    (folder / "scene.yaml").write_text(
        SCENE.format(things=things, start=start_at(height)), encoding="utf-8"
    )
    (with_files(folder) / "study.yaml").write_text(STUDY, encoding="utf-8")
    study = loaded(folder / "study.yaml")
    return rehearse(study, orders, rig=replace(Rig.build(study, simulated=True), input=hand))


def column(seen: Rehearsal, name: str) -> FloatArray:
    place = seen.run.state.index(name)
    return np.array([frame.state[place] for frame in seen.frames])


def crossings(force: FloatArray) -> int:
    """Return how often a force comes to be above the limit."""
    above = force > LIMIT_N
    return int((above[1:] & ~above[:-1]).sum())


@pytest.mark.slow
def test_what_slides_is_pushed_with_its_friction(tmp_path: Path) -> None:
    seen = run_of(tmp_path, Pusher(1), BLOCK)
    force, support = (column(seen, f"scene.block.{what}") for what in ("force.block", "support"))
    moved = np.hypot(*(np.diff(column(seen, f"scene.block.position.{axis}")) for axis in "xy"))
    window = round(0.05 * RATE_HZ) + 2
    # Steadily for as long as force and support look back.
    past = {at: moved[at - window : at] for at in range(window, len(moved))}
    sliding = [
        at for at, steps in past.items() if steps.min() > 1e-5 and np.ptp(steps) < 0.02 * steps[-1]
    ]
    assert len(sliding) > 20
    np.testing.assert_allclose(force[sliding] / support[sliding], FRICTION, rtol=0.02)


@pytest.mark.slow
def test_each_push_above_the_limit_is_one_mistake_however_it_trembles(tmp_path: Path) -> None:
    seen = run_of(tmp_path, Pusher(3), BLOCK)
    (row,) = seen.trials()
    assert crossings(column(seen, "scene.block.force.block")) > 2 * 3
    assert row["n_object"] == 3.0
    events = seen.events("contact.object")
    assert [event.data["count"] for event in events] == [1, 2, 3]
    for event in events:
        assert (event.data["thing"], event.data["limit"]) == ("block", LIMIT_N)
        assert LIMIT_N < event.data["force"] < 2 * LIMIT_N  # the tick in which it came to be above
    assert (row["outcome"], row["k"]) == ("success", 1.0)


@pytest.mark.slow
def test_an_override_lets_a_run_of_seven_pushes_reach_its_goal_with_k_1(tmp_path: Path) -> None:
    seen = run_of(tmp_path, Pusher(7), BLOCK, {240: [Command(Order.OVERRIDE)]})
    (row,) = seen.trials()
    assert (row["outcome"], row["n_object"], row["k"]) == ("success", 7.0, 1.0)
    assert not seen.events("mistakes.too_many")


@pytest.mark.slow
def test_pressing_until_the_drive_stalls_is_an_overload_in_its_direction(tmp_path: Path) -> None:
    ways = (1, -1, 1, -1, 1)
    seen = run_of(tmp_path, Presser(ways), ABOVE_AND_BELOW)
    (row,) = seen.trials()
    assert (row["n_overload_max"], row["n_overload_min"]) == (3.0, 2.0)
    assert [event.data["direction"] for event in seen.events("overload")] == list(ways)
    load = column(seen, "joint.load.arm")
    assert (load.max(), load.min()) == pytest.approx((1.0, -1.0))  # all the force there is
    assert (row["outcome"], row["k"]) == ("success", 1.0)


@pytest.mark.slow
def test_the_fifth_overload_of_one_direction_ends_the_run(tmp_path: Path) -> None:
    seen = run_of(tmp_path, Presser((1, -1) * 5), ABOVE_AND_BELOW)
    (row,) = seen.trials()
    assert (row["outcome"], row["k"]) == ("failure", 0.0)
    assert (row["n_overload_max"], row["n_overload_min"]) == (5.0, 4.0)
    assert seen.events("mistakes.too_many")[0].data["kind"] == "overload_max"
