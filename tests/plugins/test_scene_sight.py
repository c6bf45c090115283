"""Sight of the scenarios: what is to be handled is seen by the operator's first camera."""

import math
from contextlib import closing

import numpy as np
import pytest
from cranes import needs_bullet
from dmd_arms import RETRIEVAL, build
from ruamel.yaml import YAML

from labcrane.core import PlannedTrial
from labcrane.machines import load_machine, load_scene
from labcrane.testing import make_run, make_trial

pytestmark = needs_bullet

SCENES = sorted((RETRIEVAL / "scenes").glob("*.yaml"))
PASSING = {"block", "cylinder", "barrel"}
"""They only stand beside the way."""

SEEN = 0.5
"""Share of the rays through an object that must end on it."""

PASSES = 40
"""Surfaces that a ray may go through."""


def camera() -> tuple[np.ndarray, np.ndarray, float]:
    """Return eye, direction and half the angle of the study's first camera."""
    own = YAML(typ="safe").load((RETRIEVAL / "protocol.yaml").read_text())["views"]["operator"]
    eye, look = (np.array(own["camera"][key], float) for key in ("eye", "look"))
    return eye, (look - eye) / np.linalg.norm(look - eye), math.radians(own["camera"]["fov_deg"])


def seen(engine, client: int, body: int, links: range) -> float:
    """Return the share of rays from the eye that end on a body, of those that go through it."""
    eye, ahead, fov = camera()
    boxes = np.array([engine.getAABB(body, link, physicsClientId=client) for link in links])
    low, high = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)
    steps = np.linspace(0.03, 0.97, 9)
    points = np.array([low + (high - low) * (x, y, z) for x in steps for y in steps for z in steps])
    directions = (points - eye) / np.linalg.norm(points - eye, axis=1)[:, None]
    directions = directions[directions @ ahead > math.cos(fov / 2.0)]
    ends = eye + 12.0 * directions

    def hit(start: np.ndarray, end: np.ndarray) -> int:
        return engine.rayTest(start, end, physicsClientId=client)[0][0]

    first = np.array([hit(eye, end) for end in ends])
    alone = np.zeros(len(ends), bool)
    for number, end in enumerate(ends):
        start, found = eye, -2
        for _ in range(PASSES):  # through whatever stands before it
            result = engine.rayTest(start, end, physicsClientId=client)[0]
            found = result[0]
            if found in (body, -1):
                break
            start = np.array(result[3]) + 0.01 * (end - eye) / np.linalg.norm(end - eye)
        alone[number] = found == body
    assert alone.sum() > 20
    return float((first == body).sum() / alone.sum())


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_what_is_to_be_handled_is_seen_by_the_operators_first_camera(path) -> None:
    import pybullet

    machine = load_machine("ied_arm.yaml", RETRIEVAL)
    arm = build(machine, scenes=(path,))
    arm.open(make_run(machine, state=arm.signals))
    start = load_scene(path).start_deg or (0.0,) * 4
    with closing(arm):
        for seed in range(3):
            arm.reset(np.radians(start).tolist())
            arm.begin_trial(make_trial(PlannedTrial({"scenario": path.stem}, 1.0), seed=seed))
            world = arm._world
            client = world._client
            for standing in world.things:
                thing = standing.placed
                if thing.kind == "obstacle" or thing.name in PASSING:
                    continue
                links = range(-1, pybullet.getNumJoints(standing.body, physicsClientId=client))
                share = seen(pybullet, client, standing.body, links)
                assert share > SEEN, thing.name
