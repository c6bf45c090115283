"""What is written over the picture: large enough to be read, on any ground, in every language."""

import math
from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError
from windows import a_view, make_frame

from labcrane import DeviceError
from labcrane.core import SessionState, Sphere
from labcrane_view.hud import WORDS, standing
from labcrane_view.settings import ViewSettings

WHITE = Sphere("wall", (5.0, 0.0, 1.0), 40.0, (2.0, 2.0, 2.0, 1.0))
TRIAL = SessionState(trials=9, counted=3, trial=3, block=1, block_name="first")


def luminance(colour: np.ndarray) -> float:
    """Return the relative luminance of an sRGB colour, 0 to 255 (WCAG 2.2)."""
    share = colour / 255.0
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def contrast(picture: np.ndarray) -> float:
    """Return the contrast of the brightest and the commonest colour of a piece of a picture."""
    colours, counts = np.unique(picture.reshape(-1, 3), axis=0, return_counts=True)
    text = max(luminance(colour) for colour in colours)
    return (text + 0.05) / (luminance(colours[np.argmax(counts)]) + 0.05)


@pytest.mark.parametrize("content", ["white", "black"])
def test_text_has_a_contrast_of_seven_on_any_ground(content: str) -> None:
    frame = make_frame()
    frame.shapes = (WHITE,) if content == "white" else ()
    camera = {"eye": (-60.0, 0.0, 1.0), "look": (5.0, 0.0, 1.0), "fov_deg": 40.0}
    with a_view(
        hud=("block", "trial"), renderer="software", content="feedback", targets=False,
        camera=camera,
    ) as view:  # fmt: skip
        view.update(TRIAL)
        view.present(frame)
        picture = view.picture()
        height, width, _ = picture.shape
        ground = picture[height // 2, width // 2].astype(float)
        assert luminance(ground) > 0.9 if content == "white" else luminance(ground) == 0.0
        assert contrast(picture[12:30, 14:70].astype(float)) >= 7.0
        frame.paused = True
        view.present(frame)
        middle = view.picture()[height // 3 : 2 * height // 3, width // 4 : 3 * width // 4]
        assert contrast(middle.astype(float)) >= 7.0


@pytest.mark.parametrize(("arcmin", "viewing_m", "screen_mm"), [(40, 2.0, 640), (22, 0.7, 150)])
def test_capitals_are_as_high_on_the_retina_as_they_are_to_be(
    arcmin: float, viewing_m: float, screen_mm: float
) -> None:
    text = {"text_arcmin": arcmin, "viewing_m": viewing_m, "screen_mm": screen_mm}
    with a_view(hud=("trial",), renderer="software", content="feedback", **text) as view:
        view.update(TRIAL)
        view.present(make_frame())
        bright = view.picture().min(axis=-1) > 150
        first = np.flatnonzero(bright.any(axis=0))
        gap = np.flatnonzero(np.diff(first) > 1)[0]  # the first letter is a capital T
        rows = np.flatnonzero(bright[:, first[0] : first[gap] + 1].any(axis=1))
    # On the screen: 2 d tan(a / 2); here one millimetre is 640 / screen_mm pixels.
    high_mm = 2000.0 * viewing_m * math.tan(math.radians(arcmin / 60.0) / 2.0)
    assert np.ptp(rows) + 1 == pytest.approx(high_mm * 640 / screen_mm, abs=1.3)


def test_the_size_of_text_needs_the_screens_and_the_eyes_distance() -> None:
    with pytest.raises(ValidationError, match="text_arcmin needs viewing_m, the distance from the"):
        ViewSettings(text_arcmin=22)
    said = "^a picture without a screen does not report its width; measure the visible picture"
    with (
        pytest.raises(DeviceError, match=said),
        a_view(renderer="software", text_arcmin=22, viewing_m=0.7),
    ):
        pass


def test_the_record_names_the_font() -> None:
    with a_view(renderer="software", hud=("trial",)) as view:
        assert view.metadata()["font"] == "DejaVu Sans"


@pytest.mark.parametrize(
    ("paused", "situation", "word"),
    [
        (False, SessionState(), ""),
        (True, SessionState(), "paused"),
        (True, SessionState(held=("examiner",)), "paused"),
        (True, SessionState(held=("stop rule", "examiner")), "paused"),
        (True, SessionState(held=("examiner", "input")), "fault"),
        (True, SessionState(held=("feedback left",)), "fault"),
        (False, SessionState(waiting="first"), "wait"),
        (False, SessionState(waiting="break"), "wait"),
        (False, SessionState(waiting="instructions", text="Read this."), ""),
        (False, SessionState(questionnaire="NASA-TLX", waiting="first"), ""),
        (True, SessionState(waiting="first"), "paused"),
        (False, SessionState(over="complete"), "done"),
        (True, SessionState(over="incomplete", held=("input",)), "done"),
    ],
)
def test_the_state_says_why_nobody_is_to_move(
    *, paused: bool, situation: SessionState, word: str
) -> None:
    frame = make_frame()
    frame.paused = paused
    assert standing(frame, situation) == word


@pytest.mark.slow
def test_every_state_covers_the_picture_in_every_language() -> None:
    seen = {}
    states = {
        "paused": SessionState(held=("examiner",)),
        "fault": SessionState(held=("input",)),
        "wait": SessionState(waiting="first"),
        "done": SessionState(over="complete"),
    }
    for language, words in WORDS.items():
        assert set(states) <= set(words)
        with a_view(language=language, renderer="software") as view:
            frame = make_frame()
            view.present(frame)
            running = view.picture().astype(int)
            for state, situation in states.items():
                view.update(situation)
                view.present(replace(frame, paused=state in {"paused", "fault"}))
                picture = view.picture().astype(int)
                dimmed = picture[:20].sum() < 0.6 * running[:20].sum()
                letters = np.nonzero((picture.min(axis=-1) > 200) & (running.min(axis=-1) < 150))
                assert dimmed, (language, state)
                assert np.ptp(letters[1]) > 0.3 * picture.shape[1], (language, state)
                seen[language, state] = picture.tobytes()
    assert len(set(seen.values())) == len(seen) == 12
