"""Cameras with frames of their own, in depth, and what the operator is to read."""

import numpy as np
import pytest
from windows import MACHINE, SIZE, a_view, make_frame, projected, shown

from labcrane import DeviceError, Frame
from labcrane.core import SessionState, Sphere
from labcrane_view.hud import notice
from labcrane_view.settings import CAMERAS, CameraSettings

STILL = {"name": "still", "eye": (0.0, 0.0, 1.0), "look": (5.0, 0.0, 1.0)}
RATE = 240


def coloured(number: int) -> Frame:
    """Return a frame whose number can be seen: a wall of its own blue."""
    frame = make_frame(number)
    frame.shapes = (Sphere("wall", (5.0, 0.0, 1.0), 3.0, (0.0, 0.0, number / 240, 1.0)),)
    return frame


def blues(picture: np.ndarray, parts: int) -> list[int]:
    """Return the blue in the middle of every part of a window."""
    height, width, _ = picture.shape
    return [
        int(picture[height // 2, (2 * at + 1) * width // (2 * parts), 2]) for at in range(parts)
    ]


def test_cameras_of_one_window_have_rates_and_delays_of_their_own() -> None:
    beside = (
        {**STILL, "name": "late", "delay_s": 0.25},
        {**STILL, "name": "slow", "rate_hz": 4.0},
        {**STILL, "name": "slow and late", "rate_hz": 8.0, "delay_s": 0.1},
    )
    numbers = range(0, 240, 12)
    still = {"camera": STILL, "content": "feedback", "targets": False, "shadow": 0}
    levels, seen = [], []
    with a_view(**still) as view:
        for number in numbers:
            view.present(coloured(number))
            levels.append(blues(view.picture(), 1)[0])
    assert (np.diff(levels[1:]) > 0).all()
    with a_view(beside=beside, **still) as view:
        for number in numbers:
            view.present(coloured(number))
            found = [
                int(np.argmin(np.abs(np.array(levels) - at))) for at in blues(view.picture(), 4)
            ]
            seen.append([12 * at for at in found])
    for number, (now, late, slow, both) in zip(numbers, seen, strict=True):
        assert now == number
        assert late == max(0, number - 60)
        assert slow == number // 60 * 60
        taken = -(-(number // 30 * 30) // 12) * 12  # the first frame given since the grid's tick
        assert both == max(0, taken - 24)


def test_a_depth_camera_shows_how_far_away_things_are() -> None:
    frame = make_frame()
    # On the line of sight of the camera, and to its right, each as far along that line.
    balls = {"ahead": (6.0, 0.0, 1.0), "aside": (9.0, -3.0, 2.0)}
    frame.shapes = tuple(
        Sphere(name, place, 0.2, (1.0, 1.0, 1.0, 1.0)) for name, place in balls.items()
    )
    camera = {**STILL, "shows": "depth", "depth_m": (1.0, 11.0)}
    picture = shown(frame, camera=camera, targets=False, content="feedback")
    for x, y, z in balls.values():
        column, row = projected((x, y, z), CameraSettings(**camera))
        away = x - 0.2 * x / np.hypot(np.hypot(x, y), z - 1.0)  # the side that faces the eye
        grey = picture[int(row), int(column)]
        assert np.ptp(grey) == 0
        assert grey[0] == pytest.approx(255 * (11.0 - away) / 10.0, abs=1.5)
    assert picture[5, 5].tolist() == [0, 0, 0]


def test_depth_and_colour_stand_side_by_side() -> None:
    depth = {**CAMERAS["free"].model_dump(), "name": "depth", "shows": "depth", "rate_hz": 10.0}
    picture = shown(make_frame(), camera="free", beside=(depth,))
    half = SIZE[0] // 2
    assert np.ptp(picture[:, half:], axis=-1).max() == 0
    assert np.ptp(picture[:, :half], axis=-1).max() > 60


@pytest.mark.parametrize(
    ("wanted", "why"),
    [
        ({"camera": {**STILL, "shows": "depth"}}, "camera 'still' shows depth"),
        ({"camera": {**STILL, "rate_hz": 5}}, "camera 'still' has a rate or a delay of its own"),
        ({"flip": "vertical"}, "the window is flipped"),
    ],
)
def test_what_needs_opengl_is_refused_without(wanted: dict[str, object], why: str) -> None:
    said = f"^{why}, which the software renderer cannot; use OpenGL"
    with pytest.raises(DeviceError, match=said), a_view(renderer="software", **wanted):
        pass


def lower_half(view: object, frame: Frame) -> np.ndarray:
    view.present(frame)
    return view.picture()[SIZE[1] // 2 :].copy()


def test_a_hint_is_shown_for_a_while() -> None:
    with a_view(renderer="software", hint_s=1.0) as view:
        without = lower_half(view, make_frame(240))
        view.update(SessionState(hint="slower", hint_time=1.0))
        given = lower_half(view, make_frame(240))
        still = lower_half(view, make_frame(479))
        over = lower_half(view, make_frame(480))
    assert (given != without).any(axis=-1).mean() > 0.005
    np.testing.assert_array_equal(given, still)
    np.testing.assert_array_equal(over, without)


def test_instructions_stay_until_they_are_taken_away() -> None:
    text = "Bring the tip to the red ball. " * 6
    with a_view(renderer="software", notices=True) as view:
        without = lower_half(view, make_frame())
        view.update(SessionState(text=text))
        given = lower_half(view, make_frame(24000))
        view.update(SessionState())
        after = lower_half(view, make_frame())
    rows = (given != without).any(axis=(1, 2))
    assert rows.sum() > 3 * 0.05 * SIZE[1]  # several lines
    assert not rows[-5:].any()
    np.testing.assert_array_equal(after, without)


@pytest.mark.parametrize("size", [(640, 360), (400, 640)])
def test_long_instructions_fit_into_the_window(size: tuple[int, int]) -> None:
    text = "\n\n".join(
        ["Bring the tip to the red ball and hold it there until it is grey. " * 4] * 5
    )
    with a_view(renderer="software", size=size) as view:
        view.present(make_frame())
        without = view.picture().astype(int)
        view.update(SessionState(text=text))
        view.present(make_frame())
        changed = (np.abs(view.picture() - without) > 8).any(axis=-1)
    rows, columns = (np.flatnonzero(changed.any(axis=axis)) for axis in (1, 0))
    assert rows.min() > 0
    assert rows.max() < size[1] - 1
    assert np.ptp(rows) > 0.7 * size[1]
    assert columns.min() > 0
    assert columns.max() < size[0] - 1


def test_a_paragraph_of_a_text_file_is_broken_where_the_window_ends() -> None:
    text = "You steer a crane\nwith two joysticks.\n\nPlease:\n- go fast,\n  but\n- look.\n"
    (shown,) = notice(make_frame(), SessionState(text=text), 8.0, "en")
    assert shown == "You steer a crane with two joysticks.\n\nPlease:\n- go fast, but\n- look."


def test_whoever_is_asked_is_told_to_answer() -> None:
    asked = SessionState(questionnaire="NASA-TLX")
    said = [notice(make_frame(), asked, 8.0, language)[0] for language in ("en", "de", "pl")]
    assert said == [
        "Please answer the questions now:\nNASA-TLX",
        "Bitte jetzt die Fragen beantworten:\nNASA-TLX",
        "Proszę teraz odpowiedzieć na pytania:\nNASA-TLX",
    ]


def test_the_joints_load_is_in_the_corner() -> None:
    from dataclasses import replace

    from windows import a_scene

    from labcrane import Signal
    from labcrane.core import Layout
    from labcrane_view.hud import Hud

    run = a_scene()
    loads = Signal("joint.load", "1", MACHINE.names)
    loaded = replace(run, state=Layout("the machine", (*run.state.signals, loads)))
    frame = make_frame()
    frame.state = np.append(frame.state, [0.1, -0.5, 0.0, 1.0])
    (line,) = Hud(("load",), "en", loaded).lines(frame, SessionState())
    assert line == "Load slew 10 %  shoulder -50 %  elbow 0 %  wrist 100 %"
    assert Hud(("load",), "en", run).lines(make_frame(), SessionState()) == []
