"""Backdrop: what stands still is drawn once, and the picture is the one that is drawn anew."""

import math
from collections.abc import Sequence

import numpy as np
import pytest
from windows import MACHINE, a_view, make_frame

from labcrane import Frame
from labcrane.core import Sphere
from labcrane.testing import crane_at
from labcrane_view.scene.stage import Stage

WIDE = {"size": (640, 240), "beside": ({"name": "top", "eye": (4.5, 0, 15), "look": (4.6, 0, 0)},)}
LATE = {"camera": {"name": "late", "eye": (-2, 2.2, 3.3), "look": (5, 0, 1), "delay_s": 0.02}}

TOUCHING = 60
"""Pixels, of 230,400, in which two surfaces meet, so that either may be in front."""


def drawn_frames(seed: int, count: int = 6) -> list[Frame]:
    """Return frames of poses drawn at random, with a cue that is seen through."""
    random = np.random.default_rng(seed)
    frames = []
    for number in range(count):
        frame = make_frame(10 * number)
        turned = random.uniform((-math.pi, -1.0, -0.5, -0.5), (math.pi, 0.8, 1.5, 1.5))
        frame.state = crane_at(MACHINE, turned.tolist())
        centre = tuple(random.uniform((2.0, -4.0, 0.3), (7.0, 4.0, 2.0)).tolist())
        frame.shapes = (Sphere("cue", centre, 0.8, (0.9, 0.2, 0.1, 0.4)),)
        frames.append(frame)
    return frames


def pictures(frames: Sequence[Frame], **settings: object) -> list[np.ndarray]:
    """Return what a window shows of frames, once textures and shadows are made."""
    with a_view(**settings) as view:
        for _ in range(5):
            view.present(frames[0])
        found = []
        for frame in frames:
            view.present(frame)
            found.append(view.picture().astype(int))
    return found


@pytest.mark.slow
@pytest.mark.parametrize(
    "settings",
    [
        {"camera": "cab_left", "quality": "medium"},
        {"camera": "free", "quality": "low"},
        {"camera": "cab_right", "quality": "medium", "shadow": 512, "depth_cues": ("ground_grid",)},
        {"camera": "top", "quality": "medium", "flip": "horizontal"},
        {"quality": "medium", **WIDE},
        {"quality": "medium", **LATE},
    ],
    ids=["cab_left", "low", "grid", "flip", "two cameras", "late"],
)
def test_a_picture_on_a_backdrop_is_the_one_that_is_drawn_anew(
    settings: dict[str, object], monkeypatch: pytest.MonkeyPatch
) -> None:
    seed = int(np.random.SeedSequence().generate_state(1)[0])
    frames = drawn_frames(seed)
    kept = pictures(frames, **settings)
    monkeypatch.setattr(Stage, "has_scenery", False)
    anew = pictures(frames, **settings)
    for number, (one, other) in enumerate(zip(kept, anew, strict=True)):
        differs = np.abs(one - other).max(axis=-1) > 2
        assert differs.sum() <= TOUCHING, f"seed {seed}, frame {number}: {np.argwhere(differs)}"
    for after in anew[2:]:  # one camera is late by a frame
        assert (np.abs(after - anew[0]).max(axis=-1) > 30).sum() > 10 * TOUCHING, f"seed {seed}"


def test_the_scenery_is_drawn_for_the_first_pictures_only() -> None:
    with a_view(quality="medium") as view:
        for number in range(6):
            view.present(make_frame(number))
        windows = view._opened().engine.get_windows()
        backdrops = [each for each in windows if each.get_name() == "backdrop"]
        assert len(backdrops) == 2
        assert not any(each.is_active() for each in backdrops)


@pytest.mark.parametrize(
    "camera",
    [
        {"name": "wrist", "on": "wrist", "eye": (-0.6, -0.5, 0), "look": (2, 0.3, 0)},
        {"name": "deep", "eye": (-2, 2, 3), "look": (5, 0, 1), "shows": "depth"},
    ],
    ids=["that rides on a link", "of depth"],
)
def test_a_camera_that_cannot_keep_it_draws_the_scenery_itself(camera: dict[str, object]) -> None:
    with a_view(camera=camera) as view:
        view.present(make_frame())
        names = [each.get_name() for each in view._opened().engine.get_windows()]
    assert "backdrop" not in names


@pytest.mark.slow
def test_edges_of_the_scenery_are_mixed_of_both_sides_in_high_quality() -> None:
    """Without shadows nothing else differs between the qualities."""
    frame = make_frame()
    (medium,), (high,) = (
        pictures([frame], camera="free", quality=quality, shadow=0)
        for quality in ("medium", "high")
    )
    edges = np.argwhere(np.abs(high - medium).max(axis=-1) > 15)
    assert len(edges) > 2000
    around = np.lib.stride_tricks.sliding_window_view(
        np.pad(medium, ((1, 1), (1, 1), (0, 0)), "edge"), (3, 3), axis=(0, 1)
    )
    low, most = around.min(axis=(-1, -2)) - 8, around.max(axis=(-1, -2)) + 8
    mixed = ((low <= high) & (high <= most)).all(axis=-1)
    assert mixed[tuple(edges.T)].mean() > 0.95
