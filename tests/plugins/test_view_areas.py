"""Areas of interest of what moves by itself: a grapple, a body with a mesh, things of a scene."""

import struct
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from needs import GRAPHICS, need
from scipy.spatial.transform import Rotation
from windows import MACHINE, SIZE, a_scene, make_frame, projected

from labcrane import Frame, Signal
from labcrane.core import Layout, SessionState
from labcrane.machines import Body, Geom, MeshFile, PlacedObject, ShapeKind, write_placed
from labcrane_view.scene.outline import outermost
from labcrane_view.settings import CAMERAS, ViewSettings
from labcrane_view.view import View

PLACES = ((5.0, -0.5, 1.2), (6.4, 1.6, 0.9))
TURNS = ((0.0, 0.0, 0.0), (0.5, -0.3, 1.1))
AWAY = (0.0, 0.0, -50.0)
"""Below the ground, where nobody sees it."""


def moving(name: str, where: tuple[float, ...], turn: tuple[float, ...]) -> Frame:
    frame = make_frame()
    quaternion = Rotation.from_euler("xyz", turn).as_quat()
    frame.state = np.concatenate([frame.state, where, quaternion])
    return frame


@contextmanager
def a_view(moves: str, bodies: tuple[Body, ...], *areas: str) -> Iterator[View]:
    need(*GRAPHICS)
    run = a_scene()
    signals = (
        Signal(f"{moves}.position", "m", ("x", "y", "z")),
        Signal(f"{moves}.orientation", "1", ("x", "y", "z", "w")),
    )
    state = Layout("the machine", (*run.state.signals, *signals))
    settings = ViewSettings(
        camera="free", display="hidden", size=SIZE, hud=(), targets=False, shadow=0, areas=areas
    )
    with closing(View(settings, MACHINE)) as view:
        view.open(replace(run, state=state, bodies=(*run.bodies, *bodies)))
        view.present(moving(moves, AWAY, TURNS[0]))
        yield view


def box_drawn(view: View, moves: str, where: tuple[float, ...], turn: tuple[float, ...]) -> tuple:
    """Return the box of the pixels that are others when it is there."""
    view.present(moving(moves, AWAY, turn))
    without = view.picture().astype(int)
    view.present(moving(moves, where, turn))
    rows, columns = np.nonzero((np.abs(view.picture() - without) > 8).any(axis=-1))
    return columns.min(), rows.min(), columns.max() + 1, rows.max() + 1


def test_the_area_of_a_grapple_follows_it_where_it_is_drawn() -> None:
    grapple = (
        Body("grapple", 0, (0.5, 0.5, 0.5), (0.0, 0.0, 0.0), moves="grapple"),
        Body("grapple rod", 0, (0.06, 0.06, 1.2), (0.0, 0.0, 0.6), moves="grapple"),
    )
    with a_view("grapple", grapple, "grapple", "grapple rod") as view:
        for where in PLACES:
            for turn in TURNS:
                drawn = box_drawn(view, "grapple", where, turn)
                cube, rod = view.samples()["areas"].reshape(2, 4)
                both = (*np.minimum(cube, rod)[:2], *np.maximum(cube, rod)[2:])
                np.testing.assert_allclose(both, drawn, atol=2.0)
                x, y = projected(where, CAMERAS["free"])
                assert cube[0] < x < cube[2]
                assert cube[1] < y < cube[3]


def test_the_area_of_a_moving_mesh_is_that_of_its_projected_corners(tmp_path: Path) -> None:
    corners = 0.4 * np.array([[0.0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]])
    faces = ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))
    rows = [struct.pack("<12fH", 0, 0, 0, *corners[list(face)].ravel(), 0) for face in faces]
    path = tmp_path / "claw.stl"
    path.write_bytes(bytes(80) + struct.pack("<I", len(rows)) + b"".join(rows))
    claw = Body("claw", 0, (9.0, 9.0, 9.0), (0.0, 0.0, 0.0), "claw", MeshFile(file=path))
    with a_view("claw", (claw,), "claw") as view:
        for where in PLACES:
            for turn in TURNS:
                drawn = box_drawn(view, "claw", where, turn)
                (box,) = view.samples()["areas"].reshape(1, 4)
                points = Rotation.from_euler("xyz", turn).apply(corners) + where
                x, y = np.array([projected(tuple(p), CAMERAS["free"]) for p in points]).T
                expected = (x.min(), y.min(), x.max(), y.max())
                np.testing.assert_allclose(box, expected, atol=0.01)
                np.testing.assert_allclose(box, drawn, atol=2.0)


def test_the_area_of_a_thing_that_is_moved_is_what_is_drawn_of_it() -> None:
    parts = (
        Geom("head", ShapeKind.SPHERE, (0.3, 0.3, 0.3), (0.0, 0.0, 0.0), 0.0),
        Geom("torso", ShapeKind.CAPSULE, (0.9, 0.3, 0.3), (0.7, 0.0, 0.0), 0.4),
    )
    person = PlacedObject("person", "body", parts, PLACES[0], 0.0, 70.0, 0.5, 0.0, {})
    with a_view("scene.person", (), "person") as view:
        view.update(SessionState(scene=write_placed((person,))))
        for where in PLACES:
            for turn in TURNS:
                drawn = box_drawn(view, "scene.person", where, turn)
                np.testing.assert_allclose(view.samples()["areas"], drawn, atol=2.0)


def test_of_many_points_the_outermost_are_kept() -> None:
    random = np.random.default_rng(3)
    cloud = random.normal(size=(20_000, 3))
    kept = outermost(cloud)
    assert len(kept) <= 1024
    for way in random.normal(size=(50, 3)):
        reach, all_of_it = (float((points @ way).max()) for points in (kept, cloud))
        assert reach == pytest.approx(all_of_it, rel=2e-3)
