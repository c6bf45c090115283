"""Surroundings of the crane in the picture: its shadows, what hangs at the tip."""

import math
from dataclasses import replace

import numpy as np
import pytest
from windows import MACHINE, a_scene, a_view, make_frame, projected, shown

from labcrane import ProtocolError
from labcrane.core import Cylinder
from labcrane.machines import Body
from labcrane_view.framing import MARGIN, framed
from labcrane_view.scene.body import body_mesh
from labcrane_view.scene.daylight import DAY
from labcrane_view.settings import CAMERAS


@pytest.mark.slow
def test_a_poles_shadow_is_as_long_as_the_sun_is_low() -> None:
    """It ends where the ray over its top meets the ground."""
    foot, high = (4.5, -3.0), 2.0
    frame = make_frame()
    frame.task[:] = (9.0, 5.0, 0.8, 0.25, 9.0, 6.0, 0.8)  # out of the way
    bare = shown(frame, camera="top", quality="medium", targets=False)
    frame.shapes = (Cylinder("pole", (*foot, 0.0), (*foot, high), 0.12, (0.5, 0.5, 0.5, 1.0)),)
    pole = shown(frame, camera="top", quality="medium", targets=False)
    light = DAY.sun
    whole = high * math.hypot(*light[:2]) / light[2]
    away = -np.array(light[:2]) / math.hypot(*light[:2])

    def darker(share: float) -> float:
        x, y = np.array(foot) + share * whole * away
        column, row = projected((float(x), float(y), 0.0), CAMERAS["top"])
        return float((bare - pole)[int(row), int(column)].sum())

    depth = [darker(share) for share in (0.6, 0.8, 0.95)]
    assert min(depth) > 15, depth
    assert max(depth) < 400
    assert abs(darker(1.25)) <= 3


def test_a_framed_camera_holds_the_targets_within_its_picture() -> None:
    random = np.random.default_rng(np.random.SeedSequence().generate_state(1)[0])
    eye = np.array(CAMERAS["cab"].eye)
    for _ in range(20):
        points = random.uniform((3.0, -3.0, 0.2), (8.0, 3.0, 3.0), (16, 3))
        try:
            look, fov_deg = framed("cab", eye, points, 16 / 9)
        except ProtocolError:
            continue  # too wide for a flat picture: refused
        ahead = (look - eye) / np.linalg.norm(look - eye)
        right = np.cross(ahead, (0.0, 0.0, 1.0))
        right /= np.linalg.norm(right)
        up = np.cross(right, ahead)
        depth = (points - eye) @ ahead
        half = math.tan(math.radians(fov_deg / 2.0))
        across = np.abs((points - eye) @ right / depth / half)
        above = np.abs((points - eye) @ up / depth / half * 16 / 9)
        assert max(across.max(), above.max()) <= 1 / MARGIN + 1e-6


@pytest.mark.parametrize("edge", [0.4, 1.0, 1.7])
def test_a_grapple_has_tines_on_both_sides_within_the_box_that_is_its_area(edge: float) -> None:
    body = Body("grapple", 0, (edge, edge, edge), (0.0, 0.0, 0.0), moves="grapple")
    points = body_mesh(body).points
    assert np.abs(points).max() <= 0.5 * edge + 1e-9
    np.testing.assert_allclose(np.ptp(points, axis=0)[[0, 2]], edge, rtol=0.08)
    low = points[points[:, 2] < -0.3 * edge]
    assert (low[:, 0] > 0.02 * edge).any()
    assert (low[:, 0] < -0.02 * edge).any()
    middle = (np.abs(points[:, 0]) < 0.3 * edge) & (np.abs(points[:, 2]) < 0.12 * edge)
    assert not middle.any(), "there is no room for a log between the tines"
    other = replace(body, name="payload")
    assert len(body_mesh(other).points) < len(points)


def test_the_scene_has_everything_that_the_machine_is_made_of() -> None:
    with a_view() as view:
        names = {each.get_name() for each in view.stage.root.find_all_matches("**/+GeomNode")}
    assert {body.name for body in a_scene().bodies} <= names
    assert {f"{name} rod" for name in MACHINE.names[1:]} <= names
