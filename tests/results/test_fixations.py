"""Drift of gaze from the points of an eye tracker's check: recording, report and export."""

import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from labcrane import FloatArray, open_recording
from labcrane.analysis import find_cohort
from labcrane.analysis.gaze import FIXATIONS, fixations
from labcrane.analysis.report.report import write_report
from labcrane.session.commands import FeedbackReady
from labcrane_tables.settings import TableSettings
from labcrane_tables.tables import Tables
from results.recorded import STUDY, record, study

SEED = int(np.random.SeedSequence().generate_state(1)[0])
SIZE, PX_PER_M, VIEWING_M = (1920, 1080), 3600.0, 0.7
POINTS = ((0.5, 0.5), (0.1, 0.15), (0.9, 0.85))
SECONDS = 2.0
WITH_CHECKS = STUDY.replace(
    "      - block: {task: aiming}\n",
    f"      - fixation: {{seconds: {SECONDS}, points: {[list(point) for point in POINTS]}}}\n"
    "      - block: {task: aiming}\n"
    f"      - fixation: {{seconds: {SECONDS}, points: {[list(point) for point in POINTS]}}}\n",
)
FACTS = (
    "renderer llvmpipe (LLVM 15.0.6, 256 bits) (software: no graphics card takes part), "
    "size 1920x1080, quality medium, samples 1, seen_by operator, flip none, px_per_m 3600.0, "
    "viewing_m 0.7, font DejaVu Sans, delay not measured"
)
EXAMINER = FACTS.replace("operator", "examiner").replace("1920x1080", "640x360")


def ready(*facts: str) -> dict[int, list[FeedbackReady]]:
    views = enumerate(facts)
    return {0: [FeedbackReady(f"view{number}", about) for number, about in views]}


def eyes(folder: Path, offsets_deg: list[tuple[float, float]], random: np.random.Generator) -> Path:
    """Record eyes that miss every point by the offset of its check, and blink now and then.

    When the points are shown is read from a recording of the same session without eyes: its clock
    does not wait.
    """
    orders = ready(FACTS, EXAMINER)
    bare = record(study(folder / "a", WITH_CHECKS), folder / "a" / "data", "P001", orders=orders)
    events = open_recording(bare).session(1).events
    shown = events[events["name"] == "fixation.shown"]
    assert len(shown) == 2 * len(POINTS)

    def where(time: FloatArray) -> FloatArray:
        spots = np.full((len(time), 2), 300.0)
        for number, event in enumerate(shown.itertuples()):
            held = (time >= event.time + 0.2) & (time < event.time + SECONDS)
            target = np.array([event.data["x"], event.data["y"]]) * SIZE
            right, down = offsets_deg[number // len(POINTS)]
            # The median of some 180 such samples is true within .008 degrees, one standard error:
            # beyond a twentieth of a degree no draw comes by chance.
            spots[held] = looking(target, right, down) + random.normal(0.0, 3.0, (held.sum(), 2))
        # One in 33, so that every point has some: of 180 that are each lost by chance, none may be.
        spots[random.integers(33) :: 33] = math.nan
        return spots

    return record(
        study(folder / "b", WITH_CHECKS), folder / "b" / "data", "P001", orders=orders, gaze=where
    )


def looking(target: FloatArray, right_deg: float, down_deg: float) -> FloatArray:
    """Return where a ray meets the glass that is turned away from the one to the target."""
    flat = (target - np.array(SIZE) / 2.0) / PX_PER_M
    ray = np.array([flat[0], flat[1], VIEWING_M])
    ray /= np.linalg.norm(ray)
    right = np.cross([0.0, 1.0, 0.0], ray)
    right /= np.linalg.norm(right)
    down = np.cross(ray, right)
    way = np.tan(np.radians([right_deg, down_deg]))
    turned = ray + way[0] * right + way[1] * down
    return np.array(SIZE) / 2.0 + PX_PER_M * VIEWING_M * turned[:2] / turned[2]


@pytest.fixture
def random() -> np.random.Generator:
    return np.random.default_rng(SEED)


@pytest.mark.slow
def test_the_drift_of_each_check_is_found_within_a_twentieth_of_a_degree(
    tmp_path: Path, random: np.random.Generator
) -> None:
    before, after = random.normal(0.0, 0.3, 2), random.normal(0.0, 0.8, 2)
    path = eyes(tmp_path, [tuple(before), tuple(after)], random)
    found = fixations(open_recording(path).session(1))
    assert list(found.columns) == list(FIXATIONS)
    assert found["point"].tolist() == [1, 2, 3] * 2
    assert found["step"].tolist() == [1] * 3 + [3] * 3
    for step, offset in ((1, before), (3, after)):
        own = found[found["step"] == step]
        size = pytest.approx(math.hypot(*offset), abs=0.05)
        for row in own.itertuples():
            assert row.deg == size, f"seed {SEED}"
            assert 0.9 < row.valid < 1.0
            assert 0.02 < row.spread_deg < 0.5
        middle = own.iloc[0]  # where the screen is flat to the eye, the axes are its own
        assert (middle.right_deg, middle.down_deg) == pytest.approx(tuple(offset), abs=0.05)


@pytest.mark.slow
def test_a_picture_of_unknown_size_gives_pixels_and_no_degrees(
    tmp_path: Path, random: np.random.Generator
) -> None:
    facts = FACTS.replace(", px_per_m 3600.0, viewing_m 0.7", "")
    path = record(
        study(tmp_path, WITH_CHECKS), tmp_path / "data", "P001", orders=ready(facts),
        gaze=lambda time: np.tile((990.0, 530.0), (len(time), 1)),
    )  # fmt: skip
    found = fixations(open_recording(path).session(1))
    assert found["deg"].isna().all()
    assert found.iloc[0][["right_px", "down_px"]].tolist() == [30.0, -10.0]


@pytest.mark.slow
@pytest.mark.parametrize("facts", [(), (EXAMINER,)])
def test_without_the_operators_view_there_is_no_row(tmp_path: Path, facts: tuple[str, ...]) -> None:
    path = record(
        study(tmp_path, WITH_CHECKS), tmp_path / "data", "P001", orders=ready(*facts),
        gaze=lambda time: np.zeros((len(time), 2)),
    )  # fmt: skip
    assert fixations(open_recording(path).session(1)).empty


@pytest.mark.slow
def test_only_blinks_are_told_as_no_valid_sample(tmp_path: Path) -> None:
    path = record(
        study(tmp_path, WITH_CHECKS), tmp_path / "data", "P001", orders=ready(FACTS),
        gaze=lambda time: np.full((len(time), 2), math.nan),
    )  # fmt: skip
    found = fixations(open_recording(path).session(1))
    assert found["valid"].tolist() == [0.0] * 6
    assert found[["deg", "right_px"]].isna().all().all()


@pytest.mark.slow
def test_report_and_tables_hold_the_drift_before_and_after(
    tmp_path: Path, random: np.random.Generator
) -> None:
    path = eyes(tmp_path, [(0.2, 0.1), (0.6, -0.3)], random)
    cohort = find_cohort(path.parent.parent)
    page = write_report(cohort, tmp_path / "report")
    assert "Drift of gaze" in page.read_text(encoding="utf-8")
    told = pd.read_csv(tmp_path / "report" / "tables" / "drifts.csv")
    assert told["step"].tolist() == [1, 3]
    assert told["deg"].tolist() == pytest.approx(
        [math.hypot(0.2, 0.1), math.hypot(0.6, -0.3)], abs=0.05
    )
    out = tmp_path / "out"
    out.mkdir()
    Tables(TableSettings()).export(iter(cohort.included), out)
    rows = pd.read_csv(out / "fixations.csv")
    book = pd.read_csv(out / "codebook.csv")
    assert set(rows) == set(book[book["table"] == "fixations"]["column"])
    assert len(rows) == 2 * len(POINTS)
