"""What is on the screen while a crane moves: whole pictures only, in windows with names."""

import itertools
import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
import pytest
from own_modules import OWN_MODULES
from PIL import ImageGrab
from plugins.whole_picture import counted
from programs import ran
from windows import a_view, an_x_server, make_frame

from labcrane.testing import ch8
from labcrane_view.screen.placement import free_place
from labcrane_view.settings import ViewSettings

GRABS = 40
SIZE = (480, 320)


@contextmanager
def moving(display: str, renderer: str, name: str, *bare: str) -> Iterator[dict[str, int]]:
    """Open a window in which the crane turns; give what its whole pictures hold at least."""
    program = Path(__file__).with_name("moving_window.py")
    process = subprocess.Popen(
        [sys.executable, str(program), renderer, name, f"{name} - whole", *bare],
        env={**os.environ, "DISPLAY": display, "PYTHONPATH": OWN_MODULES},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        yield json.loads(process.stdout.readline())
    finally:
        process.stdin.close()
        process.wait()
        process.stdout.close()


def windows(display: str) -> dict[str, tuple[int, int]]:
    """Return where the windows are that have a name, as the X server says."""
    done = ran(["xwininfo", "-root", "-tree"], env={"DISPLAY": display}, check=True)
    found = {}
    for line in done.stdout.splitlines():
        if ' - whole"' in line:
            place = line.split()[-1]
            x, y = (int(number) for number in place.lstrip("+").split("+"))
            found[line.split('"')[1]] = (x, y)
    return found


def grabbed(renderer: str, grabs: int, *bare: str, every_s: float = 0.013) -> tuple[list[str], int]:
    """Return what grabs of two windows with a moving crane lack, and how many pictures differ.

    Where the computer draws few pictures, there are more grabs, for up to five minutes.
    """
    with an_x_server() as display, ExitStack() as both:
        least = {
            name: both.enter_context(moving(display, renderer, name, *bare))
            for name in ("operator", "examiner")
        }
        places = windows(display)
        assert set(places) == {"operator - whole", "examiner - whole"}
        halves = {name: places[f"{name} - whole"] for name in least}
        (left, top), (right, below) = halves.values()
        assert abs(right - left) >= SIZE[0] or abs(below - top) >= SIZE[1]
        broken, seen = [], set()
        until = time.monotonic() + 300.0
        for number in itertools.count():
            enough = number >= grabs and len(seen) > grabs / 2
            if enough or (number >= grabs and time.monotonic() > until):
                break
            grab = np.asarray(ImageGrab.grab(xdisplay=display))
            for name, (x, y) in halves.items():
                picture = grab[y : y + SIZE[1], x : x + SIZE[0]]
                seen.add((name, hash(picture.tobytes())))
                has = counted(picture)
                lacking = [each for each, count in least[name].items() if has[each] < 0.8 * count]
                if lacking:
                    broken.append(f"grab {number} of {name} lacks {lacking}, and has {dict(has)}")
            time.sleep(every_s)  # not in step with the pictures
        return broken, len(seen)


@pytest.mark.slow
@pytest.mark.parametrize("renderer", [pytest.param("auto", marks=pytest.mark.long), "software"])
def test_every_grab_of_two_windows_shows_whole_pictures_while_the_crane_moves(
    renderer: str,
) -> None:
    broken, pictures = grabbed(renderer, GRABS)
    assert not broken, "\n".join(broken)
    assert pictures > GRABS / 2, "the crane did not move"


@pytest.mark.soak
@pytest.mark.parametrize("renderer", ["auto", "software"])
def test_300_grabs_in_two_minutes_are_all_whole(renderer: str) -> None:
    broken, pictures = grabbed(renderer, 300, every_s=0.35)
    assert not broken, "\n".join(broken)
    assert pictures > 150, "the crane did not move"


@pytest.mark.long
def test_half_drawn_pictures_are_found_where_there_is_no_back_buffer() -> None:
    broken, _ = grabbed("software", GRABS, "bare")
    assert broken, "the check would not have found what participants saw"


@pytest.mark.parametrize("seed", range(20))
def test_no_window_lies_over_another_whatever_their_sizes(seed: int) -> None:
    random = np.random.default_rng(seed)
    desktop = tuple(random.integers((1000, 700), (4000, 2200)).tolist())
    taken: list[tuple[tuple[int, int], tuple[int, int]]] = []
    for _ in range(5):
        size = tuple(random.integers((100, 100), (1600, 1000)).tolist())
        place = free_place(size, taken, desktop)
        if place is None:
            continue
        (x, y), (width, height) = place
        assert 0 <= x <= x + width <= desktop[0]
        assert 0 <= y <= y + height <= desktop[1]
        assert width <= size[0]
        assert abs(width / size[0] - height / size[1]) < 1 / min(size)
        for (left, top), (wide, high) in taken:
            beside = x >= left + wide or left >= x + width
            assert beside or y >= top + high or top >= y + height
        taken.append(place)
    assert taken


def test_windows_lie_beside_those_before_them_where_there_is_room() -> None:
    desktop = (1920, 1080)
    operator = ((0, 0), (1280, 720))
    assert free_place((600, 500), [operator], desktop) == ((1280, 0), (600, 500))
    assert free_place((1280, 300), [operator], desktop) == ((0, 720), (1280, 300))
    second = ((1280, 0), (600, 500))
    assert free_place((600, 500), [operator, second], desktop) == ((1280, 500), (600, 500))
    # Right of it there are 640 pixels, below it 360: as much of 960x540 as fits.
    assert free_place((960, 540), [operator], desktop) == ((1280, 0), (640, 360))
    assert free_place((600, 500), [((0, 0), (1900, 1000))], desktop) is None


def test_paused_covers_the_whole_picture() -> None:
    frame = make_frame()
    with a_view(hud=None, content="feedback", targets=False) as view:
        view.present(frame)
        view.present(frame)
        running = view.picture().astype(int)
        frame.paused = True
        view.present(frame)
        view.present(frame)
        paused = view.picture().astype(int)
        frame.paused = False
        view.present(frame)
        view.present(frame)
        again = view.picture().astype(int)
    white = np.nonzero((paused.min(axis=-1) > 200) & (running.min(axis=-1) < 100))
    height, width = running.shape[:2]
    assert white[1].max() - white[1].min() > 0.5 * width
    assert white[0].max() - white[0].min() > 0.1 * height
    assert abs((white[0].max() + white[0].min()) / 2 - height / 2) < 0.05 * height
    assert abs((white[1].max() + white[1].min()) / 2 - width / 2) < 0.05 * width
    np.testing.assert_array_equal(again, running)


@pytest.mark.parametrize("digits", ["0", "1", "3", "4", "5", "7", "9"])
def test_digits_are_as_high_as_capitals_and_stand_on_the_line(digits: str) -> None:
    from panda3d import core

    from labcrane_view.screen.window import font

    def extent(text: str) -> tuple[float, float]:
        node = core.TextNode("digits")
        node.set_font(font())
        node.set_text(text)
        low, high = core.NodePath(node.generate()).get_tight_bounds()
        return low[2], high[2]

    for digit in digits:
        np.testing.assert_allclose(extent(digit), extent("H"), atol=0.04)


def test_the_operator_sees_no_distance_unless_asked_for_and_the_examiner_does() -> None:
    assert ViewSettings().hud_lines == ("block", "trial")
    assert ViewSettings(seen_by="examiner").hud_lines == ("block", "trial", "distance")
    assert ViewSettings().doubts(ch8()) == {}
    assert ViewSettings(seen_by="examiner", screen=0, hud=("distance",)).doubts(ch8()) == {}
    assert ViewSettings(seen_by="examiner", display="hidden").doubts(ch8()) == {}
    assert ViewSettings(seen_by="examiner", hud=("trial",)).doubts(ch8()) == {}
    for hud in (None, ("distance",)):
        alone = ViewSettings(seen_by="examiner", hud=hud).doubts(ch8())
        assert list(alone) == ["hud"]
        assert "with one monitor, the operator sees the task's error" in alone["hud"]
        assert "give the experimenter's monitor, as screen: 0" in alone["hud"]
    asked = ViewSettings(hud=("distance",)).doubts(ch8())
    assert "shows the operator the task's error in every group" in asked["hud"]


def test_check_warns_of_an_error_that_every_group_is_shown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from rehearsal import SHORT

    from labcrane.testing import main

    path = tmp_path / "study.yaml"
    path.write_text(SHORT + "views: {cab: {use: view, hud: [trial, distance]}}\n", encoding="utf-8")
    assert main(["check", str(path)]) == 0
    said = capsys.readouterr()
    assert "warning: views.cab.hud has distance, which shows the operator the task's" in said.out
    always = "views: {cab: {use: view, patch: {on: [target.entered]}}}\n"
    path.write_text(SHORT + always, encoding="utf-8")
    assert main(["check", str(path)]) == 0
    assert "views.cab.patch changes on target.entered, which shows the" in capsys.readouterr().out
    path.write_text(SHORT + "views: {hum: {use: sonification}}\n", encoding="utf-8")
    assert main(["check", str(path)]) == 0
    assert (
        "warning: views.hum: sonification tells how far the tip is from the target, up to 4 m and "
        "on which side the target is and whether the tip is inside the target, in every group and "
        "block; put it under feedback, where the design says who is given it"
    ) in capsys.readouterr().out
    path.write_text(SHORT + "views: {cab: {use: view, patch: {}}}\n", encoding="utf-8")
    assert main(["check", str(path)]) == 0
    assert "warning" not in capsys.readouterr().out
