"""Gaze markers in the corners: an AprilTag detector of others finds them where the record says."""

import re
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from needs import needs
from windows import SIZE, a_view, make_frame

from labcrane import ProtocolError
from labcrane.core import SessionState
from labcrane.testing import ch8
from labcrane_view.gaze_markers import CODES, pattern, placed
from labcrane_view.screen.placement import Piece
from labcrane_view.settings import (
    GAZE_MARKER_CELLS,
    GazeMarkerSettings,
    PatchSettings,
    ViewSettings,
)

SEED = int(np.random.SeedSequence().generate_state(1)[0])
NEAR_PX = 2.0
"""A detector of others blurs edges and fits lines; what is drawn is looked at by the pixel too."""

NEXT = 1
"""The software renderer may set an edge one pixel aside."""

MONITORS = (Piece(0, 0, 1920, 1080, 0, 0), Piece(1920, 120, 1280, 1024, 1960, 120))

Boxes = dict[int, npt.NDArray[np.float64]]


@pytest.fixture(scope="module")
def detector() -> Any:
    from pupil_apriltags import Detector

    class Kept(Detector):
        """Detector that is never destroyed.

        The library's own ``__del__`` frees the family of markers first and then the detector, which
        reads it once more (pupil-labs/apriltags, pull request 65): what follows in the same process
        dies of a heap that is no longer whole.
        """

        def __del__(self) -> None:
            pass

    return Kept(families="tag36h11", nthreads=1, quad_decimate=1.0)


@pytest.fixture
def random() -> np.random.Generator:
    return np.random.default_rng(SEED)


def seen(detector: Any, picture: npt.NDArray[np.uint8]) -> Boxes:
    """Return by number the left, top, right and bottom of what is found, all bits right."""
    grey = np.ascontiguousarray(picture.mean(axis=2).astype(np.uint8))
    return {
        each.tag_id: np.concatenate([each.corners.min(axis=0), each.corners.max(axis=0)])
        for each in detector.detect(grey)
        if each.hamming == 0
    }


def told(said: object) -> Boxes:
    """Return the same from the record's words."""
    found = re.findall(r"(\d+) at (-?\d+) (-?\d+) (-?\d+) (-?\d+)", str(said))
    return {int(code): np.array([float(edge) for edge in box]) for code, *box in found}


def assert_equal(found: Boxes, said: Boxes) -> None:
    assert set(found) == set(said), f"seed {SEED}"
    for code, box in said.items():
        assert found[code] == pytest.approx(box, abs=NEAR_PX), f"marker {code}, seed {SEED}"


def assert_frames(picture: npt.NDArray[np.uint8], said: Boxes, size: int) -> None:
    """Look at each black frame by the pixel: black within its edges, white around them."""
    grey, cell = picture.mean(axis=2), size // GAZE_MARKER_CELLS
    for box in said.values():
        left, top, right, bottom = box.astype(int)
        outer = grey[top - cell + NEXT : bottom + cell - NEXT, left - cell + NEXT : right + cell]
        assert outer[:, : cell - 2 * NEXT].min() == 255
        assert outer[: cell - 2 * NEXT].min() == 255
        inner = grey[top + NEXT : bottom - NEXT, left + NEXT : right - NEXT]
        edge = cell - 2 * NEXT
        frame = [inner[:edge], inner[-edge:], inner[:, :edge], inner[:, -edge:]]
        assert max(part.max() for part in frame) == 0


@needs("pupil_apriltags")
def test_every_code_is_the_one_that_trackers_know_by_its_number(detector: Any) -> None:
    for code in range(len(CODES)):
        cells = np.kron(np.array(pattern(code), np.uint8) * 255, np.ones((9, 9), np.uint8))
        sheet = np.pad(cells, 40, constant_values=90)
        assert set(seen(detector, np.dstack([sheet] * 3))) == {code}


@pytest.mark.slow
@needs("pupil_apriltags")
@pytest.mark.parametrize("renderer", ["auto", "software"])
@pytest.mark.parametrize("state", ["running", "paused"])
def test_a_tracker_finds_the_corners_where_the_record_says(
    detector: Any, renderer: str, state: str, random: np.random.Generator
) -> None:
    """Over a picture with text, a photodiode's patch and what dims it while it stands still."""
    first = int(random.integers(0, len(CODES) - 3))
    size = GAZE_MARKER_CELLS * int(random.integers(5, 16))
    corner = random.choice(["bottom_left", "bottom_right", "top_left", "top_right"])
    patch = {"corner": corner, "size": int(random.integers(20, 120))}
    markers = {"first": first, "size": size}
    with a_view(gaze_markers=markers, patch=patch, renderer=renderer, hud=("distance",)) as view:
        view.update(SessionState())
        frame = make_frame()
        frame.paused = state == "paused"
        view.present(frame)
        picture, said = view.picture(), told(view.metadata()["gaze_markers"])
    assert set(said) == set(range(first, first + 4)), f"seed {SEED}"
    assert_equal(seen(detector, picture), said)
    assert_frames(picture, said, size)


@needs("pupil_apriltags")
@pytest.mark.parametrize("flip", ["horizontal", "vertical"])
def test_behind_a_mirror_a_tracker_finds_them_and_the_record_says_where_in_the_window(
    detector: Any, flip: str
) -> None:
    """Turned over once more, as the mirror does it, the codes are right."""
    with a_view(gaze_markers={}, patch={}, flip=flip) as view:
        view.update(SessionState())
        view.present(make_frame())
        picture, said = view.picture(), told(view.metadata()["gaze_markers"])
    assert seen(detector, picture) == {}
    axis = 1 if flip == "horizontal" else 0
    along, whole = (0, 2) if axis == 1 else (1, 3), SIZE[1 - axis]
    for box in said.values():
        box[list(along)] = whole - box[list(along[::-1])]
    assert_equal(seen(detector, np.ascontiguousarray(np.flip(picture, axis))), said)


@pytest.mark.slow
def test_the_text_begins_beside_the_first_marker() -> None:
    with a_view(hud=("distance",)) as view, a_view(hud=("distance",), gaze_markers={}) as marked:
        pictures = []
        for each in (view, marked):
            each.update(SessionState())
            each.present(make_frame())
            pictures.append(each.picture().min(axis=2) > 240)
    size = GazeMarkerSettings().size
    plain, beside = pictures
    assert plain[:100, :100].any(), "the text is in the corner without markers"
    assert np.argwhere(beside[:size, size : SIZE[0] - size]).size > 0


def test_each_monitor_of_a_wide_picture_has_four_with_numbers_of_their_own() -> None:
    found = placed(GazeMarkerSettings(size=200), MONITORS, 1144)
    assert [marker.code for marker in found] == list(range(8))
    assert [(marker.left, marker.top) for marker in found] == [
        (0, 0), (1720, 0), (1720, 880), (0, 880),
        (1920, 120), (3000, 120), (3000, 944), (1920, 944),
    ]  # fmt: skip


def test_no_marker_lies_on_the_patch_and_none_leaves_its_monitor(
    random: np.random.Generator,
) -> None:
    for _ in range(300):
        corner = random.choice(["bottom_left", "bottom_right", "top_left", "top_right"])
        patch = PatchSettings(corner=str(corner), size=int(random.integers(1, 400)))
        settings = GazeMarkerSettings(size=10 * int(random.integers(2, 40)))
        for marker in placed(settings, MONITORS, 1144, patch):
            left = 0 if corner.endswith("left") else 3200 - patch.size
            top = 1144 - patch.size if corner.startswith("bottom") else 0
            apart = (
                marker.left >= left + patch.size
                or left >= marker.left + marker.size
                or marker.top >= top + patch.size
                or top >= marker.top + marker.size
            )
            assert apart, f"seed {SEED}: {marker} on {patch}"
            piece = MONITORS[marker.code // 4]
            assert piece.left <= marker.left <= piece.left + piece.width - marker.size


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"gaze_markers": {"first": 13}}, "first is 13, and four markers on each of 1 monitors go "
         "beyond the last, 15; write 12 or less"),
        ({"gaze_markers": {"first": 5}, "screens": (0, 1, 2)}, "on each of 3 monitors go beyond "
         "the last, 15; write 4 or less"),
        ({"gaze_markers": {}, "screens": (0, 1, 2, 3, 4)}, "on each of 5 monitors go beyond the "
         "last, 15; leave gaze_markers out, or fill four monitors at most"),
        ({"gaze_markers": {"size": 95}}, "multiple of 10"),
    ],
)  # fmt: skip
def test_markers_that_cannot_be_are_refused(settings: dict[str, object], said: str) -> None:
    with pytest.raises((ProtocolError, ValueError), match=re.escape(said)):
        ViewSettings(**settings)


def test_markers_larger_than_the_window_are_asked_about() -> None:
    settings = ViewSettings(size=(320, 180), gaze_markers={"size": 100})
    assert settings.doubts(ch8())["gaze_markers.size"] == (
        "is 100 pixels: two need more than the window's 180"
    )
