"""Pictures of cameras for the supervisor's page: which, when, and that they are the cameras'."""

from io import BytesIO

import matplotlib.image
import numpy as np
import pytest
from windows import SIZE, a_view, an_x_server, make_frame

from labcrane.machines import load_machine
from labcrane.streams.pictures import png
from labcrane_view.settings import ViewSettings

STILL = {"name": "still", "eye": (0.0, 0.0, 1.0), "look": (5.0, 0.0, 1.0)}
DEPTH = {**STILL, "name": "depth", "shows": "depth", "depth_m": (1.0, 11.0)}


@pytest.mark.parametrize("flip", ["none", "horizontal", "vertical"])
def test_a_picture_is_the_cameras_part_of_the_window(flip: str) -> None:
    wanted = {"cameras": ["depth"], "width": 160}
    with a_view(camera=STILL, beside=(DEPTH,), flip=flip, supervisor=wanted) as view:
        assert view.cameras == ("depth",)
        view.present(make_frame(24))
        view.present(make_frame(48))
        (name, picture), *others = view.pictures().items()
        window = view.picture()
    axes = {"horizontal": 1, "vertical": 0}
    upright = np.flip(window, axis=axes[flip]) if flip in axes else window
    assert (name, others) == ("depth", [])
    assert picture.due == make_frame(48).tick.due
    assert picture.legend == "white 1 m, black 11 m"
    half = SIZE[0] // 2
    np.testing.assert_array_equal(picture.pixels, upright[::2, half::2, 0])
    assert len(np.unique(picture.pixels)) > 20


@pytest.mark.slow
def test_pictures_come_at_their_own_rate_and_say_how_old_they_are() -> None:
    slow = {**STILL, "name": "slow", "delay_s": 0.5}
    settings = {"camera": STILL, "beside": (slow,), "shadow": 0, "supervisor": {"rate_hz": 2.0}}
    sent = []
    with a_view(**settings) as view:
        for number in range(0, 480, 24):
            view.present(make_frame(number))
            pictures = view.pictures()
            if pictures:
                assert set(pictures) == {"still", "slow"}
                dues = [pictures[name].due for name in ("still", "slow")]
                sent.append([round(240 * due) for due in dues])
    assert sent == [[0, 0], [120, 0], [240, 120], [360, 240]]


def test_a_view_sends_nothing_unless_it_is_asked_to() -> None:
    with a_view(renderer="software") as view:
        view.present(make_frame())
        assert view.cameras == ()
        assert view.pictures() == {}


def test_the_cameras_that_can_be_sent_are_those_of_the_view() -> None:
    # A name that is not among them is refused by the core: tests/protocol/test_references.py.
    settings = ViewSettings(camera=STILL, beside=(DEPTH,))
    assert settings.provides(load_machine("ch8"))["camera"] == ["still", "depth"]


@pytest.mark.parametrize("shape", [(7, 11), (5, 3, 3)])
def test_a_png_file_is_read_as_it_was(shape: tuple[int, ...]) -> None:
    pixels = np.random.default_rng(1).integers(0, 256, shape, dtype=np.uint8)
    read = matplotlib.image.imread(BytesIO(png(pixels)))
    np.testing.assert_array_equal(np.round(255 * read).astype(np.uint8), pixels)


@pytest.mark.slow
@pytest.mark.parametrize("renderer", ["auto", "software"])
def test_what_is_sent_of_a_window_is_what_is_drawn_in_it(
    renderer: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = {"camera": STILL, "renderer": renderer, "shadow": 0, "supervisor": {"width": 640}}
    sent = []
    with an_x_server() as display:
        monkeypatch.setenv("DISPLAY", display)
        for where in ("hidden", "window"):
            with a_view(display=where, **settings) as view:
                for number in (0, 120):
                    view.present(make_frame(number))
                sent.append(view.pictures()["still"].pixels.astype(int))
    assert sent[0].shape == (*SIZE[::-1], 3)
    assert np.ptp(sent[0]) > 100
    np.testing.assert_allclose(sent[1], sent[0], atol=2)
