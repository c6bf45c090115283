"""Gaze in pixels in BIDS: whose pixels they are, beside events that say what the screen was."""

import json
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from needs import needs

from labcrane.analysis import find_cohort
from labcrane.session.commands import FeedbackReady
from labcrane.testing import ch8
from labcrane_bids.bids import Bids
from labcrane_bids.settings import BidsSettings
from results.consumers import bids_errors
from results.recorded import record, study

STEM = "sub-P001/ses-01/{0}/sub-P001_ses-01_task-acquisition_{1}"
FACTS = (
    "renderer x, size 1920x1080, refresh_hz 59.95, buffers 2, seen_by operator, flip none, "
    "px_per_m 3600.0, viewing_m 0.7"
)
EXAMINER = "size 640x360, refresh_hz not known, seen_by examiner, flip none"


def exported(folder: Path, stated: list[str], *facts: str) -> Path:
    ready = {0: [FeedbackReady(f"view{number}", about) for number, about in enumerate(facts)]}
    record(study(folder), folder / "data", "P001", gaze=["cab"], stated=stated, orders=ready)
    Bids(BidsSettings(), ch8()).export(iter(find_cohort(folder / "data").included), folder / "bids")
    return folder / "bids"


@pytest.fixture(scope="module")
def bids(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Gaze on the screen, in a scene camera's picture, and in one of which nobody says whose."""
    stated = ["screen", "world", ""]
    return exported(tmp_path_factory.mktemp("gaze"), stated, FACTS, EXAMINER)


def told(folder: Path, kind: str, what: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((folder / f"{STEM.format(kind, what)}.json").read_text())
    return found


@needs("bids-validator-deno")
@pytest.mark.slow
def test_the_validator_finds_no_error_in_gaze_whosever_pixels_it_has(bids: Path) -> None:
    assert bids_errors(bids) == []


@pytest.mark.slow
def test_gaze_has_its_place_first_and_says_in_which_system(bids: Path) -> None:
    systems = []
    for number in (1, 2, 3):
        about = told(bids, "beh", f"recording-eye{number}_physio")
        assert about["Columns"] == ["timestamp", "x_coordinate", "y_coordinate"]
        assert about["x_coordinate"]["Units"] == "px"
        systems.append(about["SampleCoordinateSystem"])
    assert systems == ["gaze-on-screen", "eye-in-head", "custom"]
    assert about["SampleCoordinateSystemDescription"].startswith("in px; the picture that it")


@pytest.mark.slow
def test_logs_of_views_are_not_physio_and_the_readme_says_so(bids: Path) -> None:
    found = [path.name.split("_recording-")[1] for path in bids.rglob("*_physio.json")]
    assert sorted(found) == [f"eye{number}_physio.json" for number in (1, 2, 3)]
    text = (bids / "README").read_text(encoding="utf-8")
    assert "labcrane.feedback.cab.areas (a log of labcrane; sessions: 1)" in text


@pytest.mark.slow
def test_events_are_beside_gaze_and_say_what_the_screen_was(bids: Path) -> None:
    events = [pd.read_csv(bids / f"{STEM.format(kind, 'events')}.tsv", sep="\t")
              for kind in ("motion", "beh")]  # fmt: skip
    pd.testing.assert_frame_equal(*events)
    for kind in ("motion", "beh"):
        screen = told(bids, kind, "events")["StimulusPresentation"]
        assert screen["ScreenResolution"] == [1920, 1080]
        assert screen["ScreenSize"] == pytest.approx([1920 / 3600, 1080 / 3600])
        assert (screen["ScreenDistance"], screen["ScreenRefreshRate"]) == (0.7, 59.95)
        assert screen["ScreenOrigin"] == ["top", "left"]


@pytest.mark.slow
@needs("bids-validator-deno")
@pytest.mark.parametrize("facts", [(), (FACTS, FACTS.replace("1920", "1280"))])
def test_of_a_screen_that_is_not_known_nothing_is_said(
    tmp_path: Path, facts: tuple[str, ...]
) -> None:
    folder = exported(tmp_path, ["screen"], *facts)
    screen = told(folder, "beh", "events")["StimulusPresentation"]
    assert [name for name in screen if name.startswith("Screen")] == ["ScreenOrigin"]
    assert bids_errors(folder) == []
