"""The view: where things are in its pictures, what colour they have, and when they are shown."""

import math
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import pytest
from needs import GRAPHICS, needs
from programs import ran
from windows import (
    MACHINE,
    POSE,
    SIZE,
    a_view,
    an_x_server,
    centre_of,
    magenta,
    make_frame,
    projected,
    shown,
)

from labcrane import DeviceError, Feedback
from labcrane.core import SessionState, Sphere
from labcrane.machines import Arm
from labcrane.testing import FeedbackContract, crane_at
from labcrane_view.screen.monitors import parse
from labcrane_view.settings import CAMERAS, ViewSettings
from labcrane_view.view import View


@needs(*GRAPHICS)
class TestView(FeedbackContract):
    """Offered as "view"."""

    @pytest.fixture
    def feedback(self) -> Feedback:
        settings = ViewSettings(
            display="hidden", renderer="software", size=(160, 90), supervisor={}
        )
        return View(settings, MACHINE)


@pytest.mark.parametrize("renderer", ["auto", "software"])
@pytest.mark.parametrize("camera", ["cab_left", "cab_right", "free"])
@pytest.mark.parametrize("thing", ["tip", "target", "other", "sphere"])
def test_a_thing_is_drawn_where_a_pinhole_camera_sees_it(
    renderer: str, camera: str, thing: str
) -> None:
    frame = make_frame()
    places = {
        "tip": Arm(MACHINE).tip(POSE),
        "target": tuple(frame.task[:3]),
        "other": tuple(frame.task[4:7]),
        "sphere": (5.0, 1.0, 1.5),
    }
    frame.shapes = (Sphere("mark", places[thing], 0.12, (1.0, 0.0, 1.0, 1.0)),)
    picture = shown(
        frame, renderer=renderer, camera=camera, targets=False, content="feedback", shadow=0
    )
    x, y = centre_of(magenta(picture) | (picture[..., 0] > 40))
    expected = projected(places[thing], CAMERAS[camera])
    assert math.dist((x, y), expected) < 2.0


def test_the_end_of_the_machines_last_link_is_at_the_tip() -> None:
    frame = make_frame()
    with a_view(camera="free", areas=("wrist", "tip")) as view:
        view.present(frame)
        view.present(frame)
        link, tip = view.samples()["areas"].reshape(2, 4)
        picture = view.picture().astype(int)
    x, y = projected(Arm(MACHINE).tip(POSE), CAMERAS["free"])
    assert tip[0] < x < tip[2]
    assert tip[1] < y < tip[3]
    left, top, right, bottom = (round(edge) for edge in link)
    red, green, blue = np.moveaxis(picture, -1, 0)
    yellow = (red > 1.25 * green) & (green > 2 * blue) & (red > 60)
    inside = np.zeros_like(yellow)
    inside[top : bottom + 1, left : right + 1] = True
    rows, columns = np.nonzero(yellow & inside)
    assert abs(columns.max() + 1 - right) <= 4  # its shaded edge is not yellow enough
    assert abs(rows.max() + 1 - bottom) <= 4


@pytest.mark.parametrize("camera", ["cab_left", "free", "top"])
def test_an_area_of_interest_is_the_outline_of_what_is_drawn(camera: str) -> None:
    frame = make_frame()
    frame.shapes = (Sphere("sphere", (5.0, 1.2, 1.1), 0.6, (1.0, 1.0, 1.0, 1.0)),)
    with a_view(camera=camera, content="feedback", targets=False, areas=("sphere",)) as view:
        view.present(frame)
        box = view.samples()["areas"]
        rows, columns = np.nonzero(view.picture().max(axis=-1) > 30)
    drawn = (columns.min(), rows.min(), columns.max() + 1, rows.max() + 1)
    np.testing.assert_allclose(box, drawn, atol=1.5)


def test_what_is_behind_the_eye_has_no_area() -> None:
    frame = make_frame()
    frame.task[:3] = (-30.0, 0.0, 1.0)
    with a_view(areas=("target", "nothing")) as view:
        view.present(frame)
        assert np.isnan(view.samples()["areas"]).all()


def test_the_target_is_red_and_the_other_one_is_not() -> None:
    frame = make_frame()
    picture = shown(frame)
    colours = {}
    for name, place in (("target", frame.task[:3]), ("other", frame.task[4:7])):
        x, y = projected(tuple(place), CAMERAS["cab_left"])
        colours[name] = picture[round(y), round(x)]
    red, green, blue = colours["target"]
    assert red > 2 * max(green, blue)
    assert np.ptp(colours["other"]) < 60


@pytest.mark.slow
def test_the_machine_throws_a_shadow_on_the_ground() -> None:
    frame = make_frame()
    lit, shaded = (shown(frame, shadow=pixels, camera="free") for pixels in (0, 1024))
    x, y, z = Arm(MACHINE).tip(POSE)
    sun = np.array([0.45, -0.38, 0.81])
    ground = np.array([x, y, z]) - sun / sun[2] * z
    column, row = (round(at) for at in projected(tuple(ground), CAMERAS["free"]))
    near = np.s_[row - 6 : row + 7, column - 6 : column + 7]
    darker = (lit[near].sum(axis=-1) - shaded[near].sum(axis=-1)).max()
    assert darker > 60
    elsewhere = shaded[-40:-20, 300:340].sum(axis=-1), lit[-40:-20, 300:340].sum(axis=-1)
    np.testing.assert_allclose(*elsewhere, atol=6)


@pytest.mark.slow
@pytest.mark.parametrize(("flip", "axis"), [("horizontal", 1), ("vertical", 0)])
def test_a_mirrored_window_is_the_picture_turned_over(flip: str, axis: int) -> None:
    frame = make_frame()
    plain, mirrored = (
        shown(frame, flip=turn, hud=("distance",), patch={}) for turn in ("none", flip)
    )
    # Shading is rounded once more on its way through a texture.
    np.testing.assert_allclose(mirrored, np.flip(plain, axis=axis), atol=1)
    assert not np.array_equal(mirrored, plain)


@pytest.mark.slow
def test_the_areas_of_a_mirrored_window_are_turned_over_too() -> None:
    boxes = []
    for flip in ("none", "horizontal"):
        with a_view(flip=flip, areas=("target",)) as view:
            view.present(make_frame())
            boxes.append(view.samples()["areas"])
    left, top, right, bottom = boxes[0]
    np.testing.assert_allclose(boxes[1], [SIZE[0] - right, top, SIZE[0] - left, bottom])


def test_the_patch_changes_at_chosen_events_only() -> None:
    frame = make_frame()
    whites = []
    with a_view(patch={"on": ["trial.start"], "size": 20}) as view:
        seen: list[Mapping[str, int]] = [{}, {"trial.start": 1}, {"trial.start": 1, "waiting": 1}]
        for counts in [*seen, {"trial.start": 2, "waiting": 1}]:
            view.update(SessionState(counts=counts))
            logged = view.present(frame)[3]
            corner = view.picture()[-10, 10]
            assert set(corner) == {255 * logged}
            whites.append(logged)
    assert whites == [0.0, 1.0, 1.0, 0.0]


def test_a_camera_rides_on_a_link() -> None:
    riding = {"name": "wrist", "on": "wrist", "eye": (-0.5, -0.8, 0.0), "look": (3.0, 0.0, 0.0)}
    with a_view(camera=riding, areas=("tip",)) as view:
        boxes = []
        for angles in (POSE, (-1.0, 0.3, 0.1, 0.2)):
            frame = make_frame()
            frame.state = crane_at(MACHINE, angles)
            view.present(frame)
            boxes.append(view.samples()["areas"])
    np.testing.assert_allclose(boxes[0], boxes[1], atol=1e-6)


def test_a_delayed_view_shows_the_past() -> None:
    with a_view(renderer="software", delay_s=0.05) as view:
        ticks = [view.present(make_frame(number))[0] for number in range(0, 48, 2)]
    expected = [max(0, 2 * math.floor((number - 12) / 2)) for number in range(0, 48, 2)]
    assert ticks == expected  # 0.05 s are 12 ticks


def test_without_a_display_a_window_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    with (
        pytest.raises(DeviceError, match=r"^there is no display for a window \(DISPLAY is not"),
        a_view(display="window"),
    ):
        pass


def test_monitors_are_found_where_the_desktop_puts_them() -> None:
    listed = (
        "Monitors: 2\n 0: +*eDP-1 1920/344x1080/194+0+0  eDP-1\n"
        " 1: +HDMI-1 3840/1210x2160/680+1920+0  HDMI-1\n"
    )
    left, right = parse(listed)
    assert (left.name, left.size, left.origin) == ("eDP-1", (1920, 1080), (0, 0))
    assert (right.name, right.size, right.origin) == ("HDMI-1", (3840, 2160), (1920, 0))


@pytest.fixture(scope="module")
def x_server() -> Iterator[str]:
    with an_x_server() as display:
        yield display


@pytest.mark.slow
def test_a_window_shows_the_newest_frame_and_is_never_late(x_server: str) -> None:
    # Each frame has a colour of its own; what the X server shows is read back after each.
    program = Path(__file__).with_name("late_frames.py")
    done = ran([sys.executable, str(program)], env={"DISPLAY": x_server})
    assert done.returncode == 0, done.stderr
    behind = [int(word) for word in done.stdout.split()]
    assert len(behind) == 30
    assert set(behind) == {0}


@pytest.mark.parametrize("screen", [0, "screen"])
def test_a_monitor_is_filled_by_number_or_by_name(
    screen: int | str, x_server: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DISPLAY", x_server)
    with a_view(display="window", screen=screen, renderer="software") as view:
        view.present(make_frame())
        assert view.picture().shape == (700, 1000, 3)
