"""Scenes in the picture: objects, obstacles and the human figure, where the state says they are."""

import itertools
import json
import math
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
from cranes import needs_bullet
from needs import GRAPHICS, needs
from rehearsal import loaded

from labcrane import FloatArray, Frame, Run, Tick
from labcrane.core import SessionState
from labcrane.machines import (
    Geom,
    PlacedObject,
    ShapeKind,
    beside,
    load_scene,
    place_objects,
    read_placed,
    segments,
    stands,
    write_placed,
)
from labcrane.protocol.rig import Rig
from labcrane.streams.context import situation_after, situation_of
from labcrane.testing import Study, make_trial
from labcrane_view.areas import Projection
from labcrane_view.settings import CameraSettings, ViewSettings
from labcrane_view.view import View

pytestmark = [needs_bullet, needs(*GRAPHICS)]

RETRIEVAL = Path(__file__).parents[2] / "protocols" / "retrieval"
SCENES = ("carry", "casualty", "extract", "reach_over", "reach_through", "touch")
SIZE = (640, 480)
CAMERA = CameraSettings(eye=(1.7, -6.5, 2.4), look=(1.2, 0.0, 0.9), fov_deg=60)


@pytest.fixture(scope="module")
def study() -> Study:
    return loaded(RETRIEVAL / "protocol.yaml")


@pytest.fixture(scope="module")
def run(study: Study) -> Run:
    return Rig.build(study, simulated=True).describe(study, participant_seed=0)


@pytest.fixture(scope="module", params=["auto", "software"])
def view(request, run: Run) -> Iterator[View]:
    settings = ViewSettings(
        camera=CAMERA,
        display="hidden",
        renderer=request.param,
        size=SIZE,
        hud=(),
        targets=False,
        shadow=0,
    )
    made = View(settings, run.machine)
    made.open(run)
    with closing(made):
        yield made


def make_frame(run: Run, things: tuple[PlacedObject, ...]) -> Frame:
    """Return a frame with the arm held up and things where they were placed."""
    state = np.zeros(run.state.size)
    state[run.state.find("joint.angle")] = np.radians([0.0, -20.0, -60.0, 0.0])
    for thing in things:
        if thing.kind != "obstacle":
            for segment in segments(thing):
                move(run, state, segment.name, *stands(thing, segment.parts[0]))
    nothing = np.zeros(0)
    return Frame(Tick(0, 0.0, 0.0), 0.0, nothing, nothing, state, np.full(run.task.size, np.nan))


def move(run: Run, state: FloatArray, name: str, to: tuple[float, ...], yaw: float) -> None:
    state[run.state.find(f"scene.{name}.position")] = to
    state[run.state.find(f"scene.{name}.orientation")] = (
        0.0,
        0.0,
        math.sin(yaw / 2),
        math.cos(yaw / 2),
    )


def drawn(view: View, frame: Frame, things: tuple[PlacedObject, ...]) -> FloatArray:
    view.update(SessionState(scene=write_placed(things)))
    view.present(frame)
    view.present(frame)  # the first picture is drawn while textures are made
    return view.picture().astype(int)


def box_of(mask: np.ndarray) -> tuple[float, float, float, float]:
    assert mask.any(), "it is not in the picture"
    rows, columns = np.nonzero(mask)
    return columns.min(), rows.min(), columns.max() + 1, rows.max() + 1


def corners(part: Geom, to: tuple[float, ...], yaw: float) -> FloatArray:
    """Return points around a part, in the base frame: its outermost in every direction."""
    x, y, z = part.size
    if part.shape is ShapeKind.BOX:
        cloud = np.array(list(itertools.product((-0.5, 0.5), repeat=3))) * part.size
    elif part.shape is ShapeKind.HULL:
        cloud = np.array(part.points)
    elif part.shape is ShapeKind.CYLINDER:
        turns = np.linspace(0.0, 2.0 * math.pi, 25)
        rim = 0.5 * x * np.stack([np.cos(turns), np.sin(turns), 0.0 * turns], axis=1)
        cloud = np.vstack([rim + 0.5 * z * side * np.eye(3)[2] for side in (-1.0, 1.0)])
    else:
        around = np.random.default_rng(1).normal(size=(4000, 3))
        around /= np.linalg.norm(around, axis=1, keepdims=True)
        if part.shape is ShapeKind.SPHERE:
            cloud = 0.5 * x * around
        else:
            assert part.shape is ShapeKind.CAPSULE
            cloud = 0.5 * y * around + 0.5 * (x - y) * np.sign(around[:, :1]) * np.eye(3)[0]
    for turn, at in ((part.yaw, part.centre), (yaw, to)):
        cos, sin = math.cos(turn), math.sin(turn)
        cloud = cloud @ np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]]) + at
    return cloud


def expected(parts: Sequence[Geom], to: tuple[float, ...], yaw: float) -> FloatArray:
    eyes = Projection(np.array(CAMERA.eye), np.array(CAMERA.look), CAMERA.fov_deg, 0, *SIZE)
    boxes = np.array([eyes.points(corners(part, to, yaw)) for part in parts])
    return np.hstack([boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)])


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_everything_in_a_scene_is_drawn_where_it_stands(name: str, view: View, run: Run) -> None:
    things = place_objects(load_scene(RETRIEVAL / "scenes" / f"{name}.yaml"), 3)
    frame = make_frame(run, things)
    bare = drawn(view, frame, ())
    for thing in things:
        changed = np.abs(drawn(view, frame, (thing,)) - bare).max(axis=-1) > 12
        np.testing.assert_allclose(
            box_of(changed), expected(thing.parts, thing.position, thing.yaw), atol=3.0
        )


@pytest.mark.slow
@pytest.mark.parametrize("name", ["touch", "casualty"])
def test_what_moves_is_drawn_where_the_state_says(name: str, view: View, run: Run) -> None:
    *_, thing = place_objects(load_scene(RETRIEVAL / "scenes" / f"{name}.yaml"), 3)
    for segment in segments(thing):
        frame = make_frame(run, (thing,))
        for each in segments(thing):  # all the others out of the picture
            move(run, frame.state, each.name, (0.0, 0.0, -50.0), 0.0)
        bare = drawn(view, frame, (thing,))
        to, yaw = (1.5, -0.3, 0.4), 0.7
        move(run, frame.state, segment.name, to, yaw)
        changed = np.abs(drawn(view, frame, (thing,)) - bare).max(axis=-1) > 12
        parts = [beside(segment.parts[0], part) for part in segment.parts]
        np.testing.assert_allclose(box_of(changed), expected(parts, to, yaw), atol=3.0)


def test_a_bent_limb_can_be_seen(view: View, run: Run) -> None:
    scene = load_scene(RETRIEVAL / "scenes" / "casualty.yaml")
    straight = scene.model_copy(
        update={"figure": scene.figure.model_copy(update={"deformity": None})}
    )
    pictures = [
        drawn(view, make_frame(run, things), things)
        for things in (place_objects(each, 3) for each in (scene, straight))
    ]
    assert (np.abs(pictures[0] - pictures[1]).max(axis=-1) > 30).sum() > 50


def test_a_scene_survives_being_sent() -> None:
    for name in SCENES:
        things = place_objects(load_scene(RETRIEVAL / "scenes" / f"{name}.yaml"), 5)
        assert read_placed(write_placed(things)) == things
    assert read_placed("") == ()


def test_the_context_says_what_the_trials_seed_has_placed(study: Study, run: Run) -> None:
    task = study.tasks["retrieval"]
    planned = next(each for each in task.plan(task.factors()) if "casualty" in str(each.condition))
    task.open(run)
    task.begin_trial(make_trial(planned, seed=9))
    things = place_objects(load_scene(RETRIEVAL / "scenes" / "casualty.yaml"), 9)
    frame = make_frame(run, things)
    frame.axes = np.zeros(8)  # of the panel, whose button reports a deformity
    event, *_ = task.evaluate(frame).events
    frame.elapsed = 0.1
    assert "scene.placed" not in [event.name for event in task.evaluate(frame).events]
    assert event.name == "scene.placed"
    now = situation_after(SessionState(), event)
    assert read_placed(situation_of(json.loads(json.dumps(asdict(now)))).scene) == things


@pytest.mark.parametrize("name", [name for name in SCENES if name != "reach_through"])
@pytest.mark.parametrize("seed", range(3))
def test_all_that_stands_in_a_scene_is_within_a_narrow_picture_of_the_mast(
    name: str, seed: int, study: Study
) -> None:
    camera = study.choices["views.operator"].settings.camera
    width, height = 600, 450
    mast = Projection(np.array(camera.eye), np.array(camera.look), camera.fov_deg, 0, width, height)
    for thing in place_objects(load_scene(RETRIEVAL / "scenes" / f"{name}.yaml"), seed):
        for part in thing.parts:
            box = mast.points(corners(part, thing.position, thing.yaw))
            shares = np.array(box) / [width, height, width, height]
            assert 0.03 < shares.min() < shares.max() < 0.97, (thing.name, part.name)
