"""One picture over several monitors, and what happens when one of them is lost."""

import subprocess
from collections.abc import Iterator

import numpy as np
import pytest
from needs import need
from programs import ran
from pydantic import ValidationError
from windows import SIZE, a_view, an_x_server, centre_of, make_frame, projected

from labcrane import DeviceError
from labcrane.core import SessionState, Sphere
from labcrane_view.screen.monitors import Monitor
from labcrane_view.screen.placement import WindowPlacer, span
from labcrane_view.settings import CAMERAS, ViewSettings

LEFT, RIGHT, EXAMINER = "left", "right", "examiner"
GAP = 30
WIDE = (480 + GAP + 420, 400)
"""The whole picture: two monitors and what is hidden between them."""


def xrandr(*arguments: str) -> None:
    need("xrandr")
    subprocess.run(["xrandr", *arguments], check=True, capture_output=True)


@pytest.fixture
def desktop(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Three monitors on one desktop: 2 px are 1 mm on all of them."""
    with an_x_server() as display:
        monkeypatch.setenv("DISPLAY", display)
        xrandr("--setmonitor", LEFT, "480/240x400/200+0+0", "screen")
        xrandr("--setmonitor", RIGHT, "420/210x400/200+480+0", "none")
        xrandr("--setmonitor", EXAMINER, "600/300x300/150+0+400", "none")
        yield


def window_at(title: str) -> tuple[tuple[int, int], tuple[int, int]]:
    done = ran(["xwininfo", "-name", title], check=True)
    said = dict(
        line.strip().rsplit(":", 1) for line in done.stdout.splitlines() if ":" in line.strip()
    )
    names = ("Absolute upper-left X", "Absolute upper-left Y", "Width", "Height")
    x, y, width, height = (int(said[name]) for name in names)
    return (x, y), (width, height)


def in_window(x: float) -> float:
    """Return where a column of the wide picture is in the window; NaN behind the frames."""
    return x if x < 480 else x - GAP if x >= 480 + GAP else float("nan")


@pytest.mark.slow
@pytest.mark.parametrize("renderer", ["auto", "software"])
def test_a_window_opens_on_the_display_that_is_named_now(
    renderer: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    need("xwininfo")
    with an_x_server() as first, an_x_server() as second:
        for display, other in ((first, second), (second, first)):
            monkeypatch.setenv("DISPLAY", display)
            with a_view(display="window", renderer=renderer):
                assert window_at("labcrane")[1] == SIZE
                monkeypatch.setenv("DISPLAY", other)
                with pytest.raises(subprocess.CalledProcessError):
                    window_at("labcrane")


@pytest.mark.usefixtures("desktop")
@pytest.mark.parametrize("renderer", ["auto", "software"])
def test_one_picture_spans_two_monitors_and_goes_on_behind_their_frames(renderer: str) -> None:
    need("xwininfo")
    camera = CAMERAS["cab_left"]
    with a_view(
        display="window", screens=(LEFT, RIGHT), bezel_mm=GAP / 2, camera="cab_left",
        content="feedback", targets=False, shadow=0, renderer=renderer, areas=("mark",),
    ) as view:  # fmt: skip
        assert window_at("labcrane") == ((0, 0), (900, 400))
        unseen = 0
        for aside in np.linspace(-3.0, 3.0, 9):
            place = (5.0, float(aside), 1.0)
            frame = make_frame()
            frame.shapes = (Sphere("mark", place, 0.08, (1.0, 0.0, 1.0, 1.0)),)
            view.present(frame)
            view.present(frame)
            x, y = projected(place, camera, WIDE)
            box = view.samples()["areas"]
            found = view.picture().max(axis=-1) > 40
            if not found.any():
                assert np.isnan(box).all()
                assert not 12 < x < 468
                assert not 480 + GAP + 12 < x < WIDE[0] - 12
                unseen += 1
            elif 12 < x < 468 or 480 + GAP + 12 < x < WIDE[0] - 12:
                at = centre_of(found)
                assert at == pytest.approx((in_window(x), y), abs=2.0)
                assert ((box[0] + box[2]) / 2, (box[1] + box[3]) / 2) == pytest.approx(at, abs=1.5)
        assert unseen < 4


@pytest.mark.usefixtures("desktop")
def test_the_state_stands_on_each_monitor_and_text_on_one() -> None:
    with a_view(
        display="window", screens=(LEFT, RIGHT), renderer="software", content="feedback",
        targets=False, notices=True,
    ) as view:  # fmt: skip
        view.update(SessionState(text="Bring the tip to the red ball. " * 4))
        view.present(make_frame())
        read = view.picture()
        assert (read[:, :480] > 200).any()
        assert not (read[:, 480:] > 200).any()
        view.update(SessionState(over="complete"))
        view.present(make_frame())
        done = view.picture().min(axis=-1) > 200
    for start, end in ((0, 480), (480, 900)):
        columns = np.flatnonzero(done[:, start:end].any(axis=0))
        assert abs((columns.min() + columns.max()) / 2 - (end - start) / 2) < 5


@pytest.mark.usefixtures("desktop")
def test_a_window_goes_to_a_monitor_that_is_left_and_back_when_its_own_is_there() -> None:
    need("xwininfo")
    with a_view(display="window", screen=RIGHT, renderer="software") as view:
        handle = view._placer  # the thread that looks once a second is not waited for
        assert isinstance(handle, WindowPlacer)
        handle.close()
        assert view.present(make_frame())[-1] == 0.0
        assert window_at("labcrane") == ((480, 0), (420, 400))
        for gone, where, lost in ((True, (0, 0), 1.0), (False, (480, 0), 0.0)):
            if gone:
                xrandr("--delmonitor", RIGHT)
            else:
                xrandr("--setmonitor", RIGHT, "420/210x400/200+480+0", "none")
            handle.look()
            view.present(make_frame())
            assert view.present(make_frame())[-1] == lost
            assert window_at("labcrane") == (where, (420, 400))


@pytest.mark.usefixtures("desktop")
def test_a_monitor_that_is_not_there_is_refused_and_so_is_a_wrong_order() -> None:
    for screens, said in (
        ((LEFT, "beamer"), r"^there is no screen beamer; there is 0 \(left, 480x400\), 1 \("),
        ((RIGHT, LEFT), "^screen left is not to the right of right on the desktop; name screens:"),
    ):
        with (
            pytest.raises(DeviceError, match=said),
            a_view(display="window", screens=screens, renderer="software"),
        ):
            pass


def test_settings_that_contradict_each_other_are_refused() -> None:
    with pytest.raises(ValidationError, match="screen and screens cannot be combined; drop one"):
        ViewSettings(screen=1, screens=(1, 2))
    with pytest.raises(ValidationError, match="screens shows one wide picture, and beside asks"):
        ViewSettings(screens=(1, 2), beside=("free",))


def test_monitors_of_different_heights_show_one_picture() -> None:
    left = Monitor("a", (800, 600), (100, 200), 400)
    right = Monitor("b", (1000, 900), (900, 0), 500)
    found = span([left, right], 40)
    assert found.place == ((100, 0), (1800, 900))
    assert found.picture == (1840, 900)
    one, two = found.pieces
    assert (one.left, one.top, one.x, one.y) == (0, 200, 0, 200)
    assert (two.left, two.top, two.x, two.y) == (800, 0, 840, 0)
