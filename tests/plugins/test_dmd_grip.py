"""What the arm touches and grips: weight, force, overload, slip."""

import math
from pathlib import Path

import numpy as np
import pytest
from cranes import needs_bullet
from dmd_arms import RETRIEVAL, standing, step

from labcrane import Dynamics, ProtocolError
from labcrane.machines import load_machine, load_scene, place_objects
from labcrane.testing import RATE_HZ, make_run
from labcrane_scenario.observation import Observation
from labcrane_scenario.settings import ScenarioSettings

pytestmark = needs_bullet

BLOCK = """\
labcrane_scene: 1
title: a block
things:
  block: {shape: box, size: [0.3, 0.3, 0.2], position: [1.6, 0, 0.1001], mass_kg: 20, limit_n: 100}
  ball: {shape: sphere, size: [0.2, 0.2, 0.2], position: [1.6, 1.2, 0.1001], mass_kg: 7}
goals: [{position: [0, 0, 0], radius: 1}]
"""


def test_things_at_rest_press_on_the_ground_with_their_weight(tmp_path: Path) -> None:
    with standing(BLOCK, tmp_path) as (arm, state):
        last = step(arm, 2.0)[-1]
        for name, mass in (("block", 20.0), ("ball", 7.0)):
            support = last[state.index(f"scene.{name}.support")]
            assert support == pytest.approx(mass * 9.81, rel=0.001)
            assert last[state.index(f"scene.{name}.force.{name}")] == 0.0


def test_force_is_impulse_over_the_window(tmp_path: Path) -> None:
    # A block falls by 0.2 m and comes to rest: its support, summed up, is all its momentum and
    # its weight for the whole time.
    scene = BLOCK.replace("0.1001], mass_kg: 20", "0.3], mass_kg: 20")
    with standing(scene, tmp_path) as (arm, state):
        support = step(arm, 2.0)[:, state.index("scene.block.support")]
        assert support.sum() / RATE_HZ == pytest.approx(20 * 9.81 * 2.0, rel=0.02)
        assert support.max() > 3 * 20 * 9.81  # the window is short enough to see the impact


def press_down(arm: Dynamics, state, stop: float) -> None:
    for _ in range(round(20 * RATE_HZ)):
        force = arm.step(np.array([0.0, 60.0, 0.0, 0.0]), 1 / RATE_HZ)[
            state.index("scene.block.force.block")
        ]
        if force > stop:
            return
    raise AssertionError("the arm never reached the block")


def over_the_block() -> list[float]:
    from labcrane.machines import reach

    found = reach(load_machine("ied_arm.yaml", RETRIEVAL), (1.6, 0.0, 0.45))
    assert found is not None
    return [*found[:3], 0.0]


def test_pushing_is_felt_by_the_thing_and_by_the_joint(tmp_path: Path) -> None:
    with standing(BLOCK, tmp_path) as (arm, state):
        arm.reset(over_the_block())
        load = state.index("joint.load.arm")
        free = step(arm, 0.2)[-1][load]
        press_down(arm, state, 150.0)
        pushed = arm.state()[load]
        assert pushed > free + 0.02  # the drive now pushes down, where it held up before
        assert arm.state()[state.index("scene.block.support")] > 20 * 9.81 + 50


GRASP = """\
labcrane_scene: 1
title: something to hold
things:
  thing:
    {{shape: box, size: [0.08, 0.1, 0.2], position: [1.35, 0, 0.1001], mass_kg: 3, slip_n: {slip}}}
goals: [{{position: [0, 0, 0], radius: 1}}]
"""


def grasp(arm: Dynamics) -> None:
    from labcrane.machines import reach

    found = reach(load_machine("ied_arm.yaml", RETRIEVAL), (1.35, 0.0, 0.15))
    assert found is not None
    arm.reset([*found[:3], math.radians(45)])
    step(arm, 9.0, jaws=-100)


@pytest.mark.slow
def test_a_grip_forms_carries_and_is_let_go(tmp_path: Path) -> None:
    with standing(GRASP.format(slip=300), tmp_path) as (arm, state):
        held, height = state.index("grip.thing"), state.index("scene.thing.position.z")
        assert arm.state()[held] == 0.0
        grasp(arm)
        assert arm.state()[held] == 1.0
        lifted = step(arm, 3.0, arm=-120)
        assert lifted[-1][height] > 0.25
        assert lifted[-1][state.index("grip.force")] == pytest.approx(3 * 9.81, rel=0.3)
        let_go = step(arm, 3.0, jaws=150)
        assert let_go[-1][held] == 0.0
        assert let_go[-1][state.index("grip.left")] == 1.0
        assert let_go[-1][state.index("grip.slipped")] == 0.0
        assert let_go[-1][height] < 0.2


@pytest.mark.slow
def test_a_grip_breaks_above_the_slip_force_once_however_hard_the_jaws_still_press(
    tmp_path: Path,
) -> None:
    with standing(GRASP.format(slip=20), tmp_path) as (arm, state):
        grasp(arm)
        states = step(arm, 2.0, arm=-120, jaws=-150)
        held, loose, slipped, left = (
            states[:, state.index(f"grip.{word}")] for word in ("thing", "loose", "slipped", "left")
        )
        assert (np.diff(held) != 0.0).sum() == 1  # it is let go of, and never taken again
        assert slipped[-1] == 1.0
        assert loose[-1] == 1.0 - left[-1]
        step(arm, 3.0, jaws=150)
        assert arm.state()[state.index("grip.left")] == 1.0


@pytest.mark.slow
@pytest.mark.parametrize(("lift_s", "drops"), [(0.4, 0), (3.0, 1)])
def test_letting_go_high_up_is_a_drop_and_setting_down_is_none(
    lift_s: float, drops: int, tmp_path: Path
) -> None:
    with standing(GRASP.format(slip=300), tmp_path) as (arm, state):
        run = make_run(load_machine("ied_arm.yaml", RETRIEVAL), state=state.signals)
        settings = ScenarioSettings(scenes=(tmp_path / "scene.yaml",))
        watch = Observation(settings, run, place_objects(load_scene(settings.scenes[0]), 0))
        grasp(arm)
        list(watch.see(arm.state(), 0.0))
        states = [*step(arm, lift_s, arm=-120), *step(arm, 2.0), *step(arm, 3.0, jaws=150)]
        states.extend(step(arm, 1.0, arm=-120))
        events = [event for values in states for event in watch.see(values, 0.0)]
    found = [event for event in events if event.name == "drop"]
    held = [values for values in states if values[state.index("grip.thing")]]
    fell = held[-1][state.index("scene.thing.position.z")] - 0.1  # it is 0.2 m high and upright
    assert held[-1][state.index("grip.height")] == pytest.approx(fell, abs=0.03)
    assert (fell > settings.drop_m) == bool(drops)
    assert [(each.data["thing"], each.data["slipped"]) for each in found] == (
        [("thing", False)] * drops
    )
    assert watch.mistakes.counts["drop"] == drops
    assert all(each.data["height"] > settings.drop_m for each in found)


def test_things_that_overlap_are_refused_in_words(tmp_path: Path) -> None:
    inside = BLOCK.replace("[1.6, 1.2, 0.1001]", "[1.6, 0.1, 0.1001]")
    with (
        pytest.raises(ProtocolError, match=r"'ball' overlaps 'block' by 0.\d+ m at the start"),
        standing(inside, tmp_path),
    ):
        pass
