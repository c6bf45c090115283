"""Somebody with joints: masses, stops, rest, and contacts with what is fixed, limb by limb."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from cranes import needs_bullet
from dmd_arms import RETRIEVAL, standing

from labcrane.core import Event
from labcrane.machines import load_machine, load_scene, place_objects, segments
from labcrane.machines.human_figure import REGIONS
from labcrane.testing import RATE_HZ, make_run
from labcrane_scenario.observation import Observation
from labcrane_scenario.settings import ScenarioSettings

pytestmark = needs_bullet

FIGURE = """\
labcrane_scene: 1
title: somebody who lies there
figure:
  jointed: true
  position: [2.0, 3.0, 0.115]
  limbs_deg: {{left_upper_arm: 70, right_upper_arm: 20, left_thigh: 10, right_thigh: 10}}
  deformity: {{limbs: [right_shank]}}
  limits_n: {{{limits}}}
{things}goals: [{{position: [30, 0, 0], radius: 0.1}}]
"""
STILL = (0.0, 0.0, 0.0, 0.0)


def text_of(limit: float = 100.0, things: str = "") -> str:
    limits = ", ".join(f"{name}: {limit}" for name in REGIONS)
    return FIGURE.format(limits=limits, things=f"things: {{{things}}}\n" if things else "")


class Doll:
    """The figure of an open arm, in the engine."""

    def __init__(self, arm) -> None:
        import pybullet

        self.arm, self.engine = arm, pybullet
        world = arm._world
        self.client = world._client
        self.standing = next(each for each in world.things if each.placed.jointed)
        self.body = self.standing.body
        count = pybullet.getNumJoints(self.body, physicsClientId=self.client)
        self.joints = range(count)
        self.ranges = np.array(
            [
                pybullet.getJointInfo(self.body, joint, physicsClientId=self.client)[8:10]
                for joint in self.joints
            ]
        )

    def link(self, region: str) -> int:
        return self.standing.segments.get(f"figure.{region}", (-1, None))[0]

    def mass(self, link: int) -> float:
        return self.engine.getDynamicsInfo(self.body, link, physicsClientId=self.client)[0]

    def push(self, link: int, force: tuple[float, float, float]) -> None:
        at = (
            self.engine.getBasePositionAndOrientation(self.body, physicsClientId=self.client)[0]
            if link < 0
            else self.engine.getLinkState(self.body, link, physicsClientId=self.client)[0]
        )
        self.engine.applyExternalForce(
            self.body, link, force, at, self.engine.WORLD_FRAME, physicsClientId=self.client
        )

    def tick(self, ticks: int = 1) -> np.ndarray:
        for _ in range(ticks):
            state = self.arm.step(np.array(STILL), 1 / RATE_HZ)
        return state.copy()

    def beyond(self) -> float:
        """Return by how much the joint that is most out of its range is so, in rad."""
        states = self.engine.getJointStates(self.body, self.joints, physicsClientId=self.client)
        angles = np.array([state[0] for state in states])
        return float(np.maximum(self.ranges[:, 0] - angles, angles - self.ranges[:, 1]).max())

    def energy(self) -> float:
        """Return kinetic and potential energy in J, of every link from its own motion."""
        engine, client = self.engine, self.client
        base = engine.getBasePositionAndOrientation(self.body, physicsClientId=client)
        links = engine.getLinkStates(
            self.body,
            self.joints,
            computeLinkVelocity=1,
            computeForwardKinematics=1,
            physicsClientId=client,
        )
        moving = [(-1, *base, *engine.getBaseVelocity(self.body, physicsClientId=client))]
        moving += [(number, *each[:2], *each[6:8]) for number, each in enumerate(links)]
        total = 0.0
        for link, place, turn, speed, spin in moving:
            mass, _, inertia, *_ = engine.getDynamicsInfo(self.body, link, physicsClientId=client)
            own = np.reshape(engine.getMatrixFromQuaternion(turn), (3, 3)).T @ spin
            kinetic = mass * np.dot(speed, speed) + np.dot(inertia, own * own)
            total += 0.5 * kinetic + mass * 9.81 * place[2]
        return total


@contextmanager
def lying(folder: Path, text: str) -> Iterator[tuple[Doll, object]]:
    with standing(text, folder) as (arm, state):
        yield Doll(arm), state


def test_masses_are_those_of_segments_and_together_the_persons(tmp_path: Path) -> None:
    with lying(tmp_path, text_of()) as (doll, _):
        assert sum(doll.mass(link) for link in (-1, *doll.joints)) == pytest.approx(75.0)
        between = 0.02  # each of the links between two hinges of a joint
        for region, share, hinges in (
            ("head", 0.0694, 2),
            ("torso", 0.3229, 1),
            ("left_thigh", 0.1416, 3),
            ("right_forearm", 0.0223, 1),
        ):
            expected = 75.0 * share - between * (hinges - 1)
            assert doll.mass(doll.link(region)) == pytest.approx(expected)


@pytest.mark.long
def test_at_rest_for_a_minute_energy_does_not_grow_and_joints_stay_in_their_ranges(
    tmp_path: Path,
) -> None:
    with lying(tmp_path, text_of()) as (doll, _):
        doll.tick(240)  # falls by a few centimetres first
        energy, beyond = [doll.energy()], [doll.beyond()]
        for _ in range(60):
            doll.tick(240)
            energy.append(doll.energy())
            beyond.append(doll.beyond())
    rises = np.diff(energy)
    assert max(energy) - energy[0] < 0.01  # of 66 J: 15 micrometres of the whole body's height
    assert rises.max() < 0.005
    assert max(beyond) < math.radians(0.1)


@pytest.mark.parametrize("seed", range(2))
def test_joints_hold_together_and_stop_however_the_limbs_are_pulled(
    seed: int, tmp_path: Path
) -> None:
    random = np.random.default_rng(seed)
    with lying(tmp_path, text_of()) as (doll, state):
        (figure,) = place_objects(load_scene(tmp_path / "scene.yaml"), 0)
        thigh, shank = (
            next(each for each in segments(figure) if each.name == f"figure.left_{name}")
            for name in ("thigh", "shank")
        )
        for _ in range(4):
            link = doll.link(str(random.choice(REGIONS)))
            force = random.normal(size=3) * 60.0
            for _ in range(60):
                doll.push(link, tuple(force))
                values = doll.tick()
                assert doll.beyond() < math.radians(3.0)
            ends = [
                end_of(values, state, each.name, side * 0.5 * each.parts[0].size[0])
                for each, side in ((thigh, 1.0), (shank, -1.0))
            ]
            np.testing.assert_allclose(*ends, atol=1e-3)  # the knee, from both sides


@pytest.mark.parametrize("seed", range(3))
def test_beside_somebody_with_joints_the_arm_does_not_creep_under_a_load(
    seed: int, tmp_path: Path
) -> None:
    random = np.random.default_rng(seed)
    pull = (0.0, 0.0, -float(random.uniform(300.0, 700.0)))  # N: up to a whole person
    with standing(text_of(), tmp_path) as (arm, state):
        pose = np.radians([random.uniform(-160, 0), *random.uniform(-15, 25, 2), 30.0])
        arm.reset(tuple(pose.tolist()))
        doll = Doll(arm)
        world, boom = arm._world, 2
        assert doll.engine.getPhysicsEngineParameters(doll.client)["numSolverIterations"] == 150
        angles = []
        for _ in range(2 * round(RATE_HZ)):
            at = doll.engine.getLinkState(world.arm, boom + 1, physicsClientId=doll.client)[0]
            doll.engine.applyExternalForce(
                world.arm, boom, pull, at, doll.engine.WORLD_FRAME, physicsClientId=doll.client
            )
            values = doll.tick()
            angles.append(values[state.find("joint.angle")])
            assert values[state.find("tip.position")][2] > 0.3  # it hangs free
        # With 50 passes it is 2e-6 degrees and more, with 150 rounding.
        assert np.degrees(np.abs(angles[-1] - angles[0])).max() < 1e-8


def end_of(values: np.ndarray, state, name: str, along: float) -> np.ndarray:
    """Return a point on a segment's axis, so far from the middle of its first part."""
    x, y, z, w = values[state.find(f"scene.{name}.orientation")]
    ahead = np.array([1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)])
    return values[state.find(f"scene.{name}.position")] + along * ahead


def seen_by(run, placed) -> tuple[Observation, list[Event]]:
    return Observation(ScenarioSettings(scenes=(Path("scene.yaml"),)), run, placed), []


@pytest.mark.slow
def test_every_limb_that_is_pressed_against_something_fixed_is_a_mistake_of_its_own(
    tmp_path: Path,
) -> None:
    (tmp_path / "bare.yaml").write_text(text_of(), encoding="utf-8")
    (bare,) = place_objects(load_scene(tmp_path / "bare.yaml"), 0)
    machine = load_machine("ied_arm.yaml", RETRIEVAL)
    push = {
        "torso": 1200.0,
        "pelvis": 1000.0,
        "thigh": 500.0,
        "shank": 200.0,
        "head": 200.0,
        "arm": 150.0,
    }
    for segment in segments(bare):
        region = segment.parts[0].name
        x, y, _ = segment.parts[0].centre
        lid = (
            "lid: {shape: box, size: [0.06, 0.06, 0.04], fixed: true, "
            f"position: [{2.0 + x:.4f}, {3.0 + y:.4f}, 0.28]}}"
        )
        with lying(tmp_path, text_of(40.0, lid)) as (doll, state):
            run = make_run(machine, state=state.signals)
            placed = place_objects(load_scene(tmp_path / "scene.yaml"), 0)
            watch, events = seen_by(run, placed)
            for number in range(96):
                if number > 12:
                    doll.push(doll.link(region), (0.0, 0.0, push.get(region.split("_")[-1], 110.0)))
                events += watch.see(doll.tick(), number / RATE_HZ)
        found = {(event.name, event.data["part"], event.data["against"]) for event in events}
        assert found == {("contact.body", region, "fixed")}, region
        assert watch.mistakes.counts["body"] == len(events)


def watched_on_the_ground(folder: Path, text: str, ticks: int, push=None) -> list[Event]:
    """Return what is wrong with somebody on the ground; ``push`` presses after half a second."""
    with lying(folder, text) as (doll, state):
        run = make_run(load_machine("ied_arm.yaml", RETRIEVAL), state=state.signals)
        watch, events = seen_by(run, place_objects(load_scene(folder / "scene.yaml"), 0))
        for number in range(ticks):
            if push is not None and number > RATE_HZ / 2:
                doll.push(doll.link(push[0]), (0.0, 0.0, -push[1]))
            values = doll.tick()
            events += watch.see(values, number / RATE_HZ)
        whole = values[state.find("scene.figure.ground")].sum()
        assert whole == pytest.approx(values[state.index("scene.figure.support")])
        assert watch.mistakes.counts["body"] == len(events)
    return events


@pytest.mark.slow
def test_every_limb_that_is_pressed_onto_the_ground_is_a_mistake_and_lying_there_is_none(
    tmp_path: Path,
) -> None:
    own = ", ".join(f"{name}: 250" for name in REGIONS)
    text = text_of().replace("  limits_n", f"  ground_n: {{{own}}}\n  limits_n")
    assert watched_on_the_ground(tmp_path, text, 360) == []
    for region in ("torso", "pelvis", "head", "left_forearm", "right_thigh", "left_shank"):
        events = watched_on_the_ground(tmp_path, text, 240, (region, 600.0))
        assert region in {event.data["part"] for event in events}
        assert {(event.name, event.data["against"]) for event in events} == {
            ("contact.body", "ground")
        }


@pytest.mark.parametrize("carrier", ["", "stretcher"])
def test_somebody_who_falls_is_hurt_by_the_ground_and_by_the_stretcher_under_them(
    carrier: str, tmp_path: Path
) -> None:
    part = RETRIEVAL / "scenes" / "parts" / "stretcher.yaml"
    things = f"bed: {{use: {part}, position: [2.4, 3.0, 0]}}" if carrier else ""
    text = text_of(things=things).replace("3.0, 0.115]", "3.0, 2.0]")
    events = watched_on_the_ground(tmp_path, text, 360)
    assert {event.data["against"] for event in events} == {"ground"}
    assert {"torso", "pelvis"} <= {event.data["part"] for event in events}
    half = 0.5 * 75.0 * 9.81  # of the whole weight: what a limb may have by default
    assert all(event.data["limit"] == pytest.approx(half) for event in events)
    assert max(event.data["force"] for event in events) > half


POST = """\
labcrane_scene: 1
title: a post in the way
things:
  post:
    {{shape: box, size: [0.1, 0.1, {height}], position: [{x:.4f}, {y:.4f}, {middle:.4f}],
      fixed: true, limit_n: 60}}
goals: [{{position: [30, 0, 0], radius: 0.1}}]
"""


@pytest.mark.parametrize(
    ("radius", "bearing_deg", "height", "link"),
    [(0.2, 0, 0.5, "base"), (0.6, 15, 1.2, "arm"), (1.5, 8, 1.2, "boom"), (2.16, 8, 1.2, "jaw")],
)
def test_each_link_that_hits_something_fixed_is_counted_and_named(
    radius: float, bearing_deg: float, height: float, link: str, tmp_path: Path
) -> None:
    turn = math.radians(bearing_deg)
    text = POST.format(
        height=height, middle=height / 2, x=radius * math.cos(turn), y=radius * math.sin(turn)
    )
    with standing(text, tmp_path) as (arm, state):
        arm.reset([0.0, math.radians(60), math.radians(-60), 0.0])
        run = make_run(load_machine("ied_arm.yaml", RETRIEVAL), state=state.signals)
        watch, events = seen_by(run, place_objects(load_scene(tmp_path / "scene.yaml"), 0))
        place, links = state.index("scene.post.force.post"), state.find("contact.fixed")
        for number in range(480):
            values = arm.step(np.array([250.0, 0.0, 0.0, 0.0]), 1 / RATE_HZ)
            assert values[links].sum() == pytest.approx(values[place])
            events += watch.see(values, number / RATE_HZ)
            if any(event.name == "contact.object" for event in events):
                break
    (hit,) = [event for event in events if event.name == "contact.object"]
    assert hit.data["thing"] == "post"
    assert str(hit.data["link"]).split("_")[0] == link
    assert hit.data["force"] > hit.data["limit"] == 60.0
    assert watch.mistakes.counts["object"] == 1
