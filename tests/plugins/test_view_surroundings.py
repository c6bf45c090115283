"""Surroundings of the crane in the picture: time of day, a cab, what hangs at the tip."""

import math
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from windows import MACHINE, a_scene, a_view, make_frame, projected, shown

from labcrane import ProtocolError
from labcrane.core import Cylinder
from labcrane.machines import Body
from labcrane_view.framing import MARGIN, framed
from labcrane_view.scene.body import body_mesh
from labcrane_view.scene.cab import CLEAR
from labcrane_view.scene.daylight import DAYLIGHT
from labcrane_view.settings import CAMERAS

SEAT = {"name": "seat", "eye": (-2.2, 2.2, 3.3), "look": (5.2, 0.3, 0.8)}


@pytest.mark.slow
@pytest.mark.parametrize("renderer", ["auto", "software"])
def test_every_time_of_day_has_light_of_its_own(renderer: str) -> None:
    pictures = {
        time: shown(make_frame(), daylight=time, camera="free", renderer=renderer)
        for time in DAYLIGHT
    }
    for one, other in combinations(pictures, 2):
        assert np.abs(pictures[one] - pictures[other]).mean() > 3, (one, other)
    bright = {time: picture.mean() for time, picture in pictures.items()}
    assert min(bright, key=bright.__getitem__) == "dusk"


@pytest.mark.slow
@pytest.mark.parametrize("time", DAYLIGHT)
def test_a_poles_shadow_is_as_long_as_the_sun_is_low(time: str) -> None:
    """It ends where the ray over its top meets the ground; under clouds it is hardly there."""
    foot, high = (4.5, -3.0), 2.0
    frame = make_frame()
    frame.task[:] = (9.0, 5.0, 0.8, 0.25, 9.0, 6.0, 0.8)  # out of the way
    bare = shown(frame, daylight=time, camera="top", quality="medium", targets=False)
    frame.shapes = (Cylinder("pole", (*foot, 0.0), (*foot, high), 0.12, (0.5, 0.5, 0.5, 1.0)),)
    pole = shown(frame, daylight=time, camera="top", quality="medium", targets=False)
    light = DAYLIGHT[time].sun
    whole = high * math.hypot(*light[:2]) / light[2]
    away = -np.array(light[:2]) / math.hypot(*light[:2])

    def darker(share: float) -> float:
        x, y = np.array(foot) + share * whole * away
        column, row = projected((float(x), float(y), 0.0), CAMERAS["top"])
        return float((bare - pole)[int(row), int(column)].sum())

    depth = [darker(share) for share in (0.6, 0.8, 0.95)]
    assert min(depth) > (3 if time == "overcast" else 15), depth
    assert max(depth) < (60 if time == "overcast" else 400)
    assert abs(darker(1.25)) <= 3


@pytest.mark.slow
@pytest.mark.parametrize("quality", ["medium", "high"])
def test_a_cabs_window_hides_the_edges_and_nothing_in_the_middle(quality: str) -> None:
    frame = make_frame()
    free = shown(frame, camera=SEAT, quality=quality)
    seen = shown(frame, camera={**SEAT, "cab_frame": True}, quality=quality)
    height, width, _ = seen.shape
    hidden = np.abs(seen - free).max(axis=-1) > 10
    across, down = (int(0.5 * (1.0 - CLEAR) * size) for size in (width, height))
    assert not hidden[down : height - down, across : width - across].any()
    for side in (hidden[:, : width // 40], hidden[:, -width // 40 :]):
        assert side[height // 4 : -height // 4].mean() > 0.5
    assert hidden[0].mean() > 0.9
    assert hidden[-1].mean() > 0.9
    assert seen[0].max() < 90


@pytest.mark.slow
def test_only_the_camera_in_the_cab_sees_it() -> None:
    """One that stands behind would have its bars in the middle of the picture."""
    behind = {"name": "behind", "eye": (-4.2, 2.7, 3.95), "look": (5.2, 0.3, 0.8)}
    wide = {"size": (1280, 360), "camera": behind}
    alone = shown(make_frame(), beside=(SEAT,), **wide)
    beside = shown(make_frame(), beside=({**SEAT, "cab_frame": True},), **wide)
    np.testing.assert_allclose(beside[:, :640], alone[:, :640], atol=2)
    assert np.abs(beside[:, 640:] - alone[:, 640:]).max() > 50


def test_a_framed_camera_in_a_cab_holds_the_targets_within_the_window() -> None:
    random = np.random.default_rng(np.random.SeedSequence().generate_state(1)[0])
    eye = np.array(CAMERAS["cab"].eye)
    for _ in range(20):
        points = random.uniform((3.0, -3.0, 0.2), (8.0, 3.0, 3.0), (16, 3))
        try:
            look, fov_deg = framed("cab", eye, points, 16 / 9, CLEAR)
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
        assert max(across.max(), above.max()) <= CLEAR / MARGIN + 1e-6


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
