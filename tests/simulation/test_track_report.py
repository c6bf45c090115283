"""Thresholds in the report of a study with tracks: everybody's, and how far they are off."""

from pathlib import Path

import pandas as pd
import pytest
from results.undrawn import without_figures
from simple_crane import CRANE

from labcrane import open_recording
from labcrane.analysis import find_cohort
from labcrane.analysis.report.report import write_report
from labcrane.simulation.track_cohort import OPERATORS, STEEPNESS
from labcrane.testing import main

STUDY = (
    """\
labcrane: 1
study: reported
title: Two tracks
rate_hz: 60
"""
    + CRANE
    + """\
tasks:
  aiming: {use: aiming, distances: [1, 2, 3, 4], movements: 1}
design:
  tracks:
    quest:
      factor: pairs
      levels: &levels {1m_far_left: 1, 2m_far_left: 2, 3m_far_left: 3, 4m_far_left: 4}
      quest_plus: {spreads: [0.5]}
      rounds: 4
      measure: movement_time
      at_most: 7.0
    stairs:
      factor: pairs
      levels: *levels
      up_down: {harder_after: 1, reversals: 4, leave_out: 0}
      rounds: 30
      measure: movement_time
      at_most: 7.0
sessions:
  - {name: one, steps: [{block: {task: aiming, track: quest, name: first}}]}
  - {name: two, steps: [{block: {task: aiming, track: stairs}}]}
"""
)
PEOPLE = ("P001-SIMULATED", "P002-SIMULATED")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Simulated and reported as users do it."""
    folder = tmp_path_factory.mktemp("tracks")
    (folder / "protocol.yaml").write_text(STUDY)
    data = str(folder / "data")
    assert main(["simulate", str(folder), "--participants", "2", "--out", data]) == 0
    words = ["--include", "simulated", "--workers", "1"]
    with without_figures():
        assert main(["report", data, "--out", str(folder / "report"), *words]) == 0
    return folder


def told(folder: Path, name: str) -> pd.DataFrame:
    return pd.read_csv(folder / "report" / "tables" / f"{name}.csv")


@pytest.mark.slow
def test_everybodys_thresholds_are_those_that_their_sessions_ended_with(folder: Path) -> None:
    found = told(folder, "thresholds").set_index(["participant", "session"])
    assert len(found) == 4
    for name in PEOPLE:
        recording = open_recording(folder / "data" / name / f"{name}.h5")
        for session, track in ((1, "quest"), (2, "stairs")):
            events = recording.session(session).events
            (end,) = events.loc[events["name"] == "track.end", "data"]
            row = found.loc[name, session]
            assert row["track"] == end["track"] == track
            assert row["estimate"] == pytest.approx(end["estimate"], nan_ok=True)
            assert row["responses"] == end["responses"] > 0
    assert found["estimate"].between(1.0, 4.0).all()
    page = (folder / "report" / "report.html").read_text(encoding="utf-8")
    assert ">Thresholds</h2>" in page


@pytest.mark.slow
def test_bias_and_spread_of_each_track_are_told_from_a_thousand_operators(folder: Path) -> None:
    quality = told(folder, "track_quality")
    assert OPERATORS == 1000
    assert (quality["operators"] == OPERATORS).all()
    quest = quality[quality["track"] == "quest"]
    assert quest["steepness"].tolist() == ["believed"]
    # Four answers tell little, and less than the evenly spread thresholds' own sqrt(9 / 12).
    assert 0.3 < quest["spread"].item() < (9 / 12) ** 0.5
    assert abs(quest["bias"].item()) < 0.1 * quest["spread"].item()
    assert quest["trials"].item() == 4.0
    stairs = quality[quality["track"] == "stairs"]
    assert [float(each) for each in stairs["steepness"]] == list(STEEPNESS)
    assert (stairs["spread"] > 0).all()
    assert stairs["spread"].is_monotonic_increasing  # shallow success is harder to find


@pytest.mark.slow
def test_a_study_without_tracks_has_no_word_of_thresholds(tmp_path: Path) -> None:
    text = STUDY.replace("track: quest, ", "").replace(", track: stairs", ", pairs: 1")
    text = text[: text.index("design:")] + text[text.index("sessions:") :]
    (tmp_path / "protocol.yaml").write_text(text.replace("name: first", "pairs: 1"))
    data = tmp_path / "data"
    assert main(["simulate", str(tmp_path), "--participants", "1", "--out", str(data)]) == 0
    page = write_report(find_cohort(data, ["simulated"]), tmp_path / "report")
    assert "Thresholds" not in page.read_text(encoding="utf-8")
    assert not (tmp_path / "report" / "tables" / "thresholds.csv").exists()
