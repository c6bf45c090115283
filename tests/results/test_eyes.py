"""Gaze by eye: which channels are of which eye, and where an eye that is asked for is known."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.random import default_rng

from labcrane import FloatArray, RecordingError, open_recording
from labcrane.analysis import codebook_of, find_cohort, measures_of
from labcrane.analysis.gaze import Looks, looks
from labcrane.analysis.measures import MeasureSettings, measure_session
from labcrane.core import SignalChannel, eyes_of
from labcrane.recording import Channel, SessionRecord, StreamHeader, XdfWriter
from results.recorded import STUDY, record, study, write_stream

LIMIT = 0.6
MONITORED = f"{STUDY}streams:\n  gaze: {{type: Gaze, required: false}}\nmonitors:\n" + (
    f"  eyes: {{use: gaze_signal, confidence: {LIMIT}}}\n"
)
SIDES = ("left", "right")


@dataclass(frozen=True)
class Truth:
    session: SessionRecord
    path: Path
    time: FloatArray
    seen: dict[str, np.ndarray]
    places: dict[str, FloatArray]


@pytest.fixture(scope="module")
def truth(tmp_path_factory: pytest.TempPathFactory) -> Truth:
    """The left eye is lost nine times of ten in runs, the right one seldom, each in any way."""
    random = default_rng()
    folder = tmp_path_factory.mktemp("eyes")
    made: dict[str, FloatArray] = {}
    seen: dict[str, np.ndarray] = {}
    places: dict[str, FloatArray] = {}

    def write(writer: XdfWriter, end: float, events: FloatArray) -> None:
        time = np.arange(95.0, end, 1.0 / 60.0)
        made["time"] = time
        columns, channels = [], []
        for side, share in zip(SIDES, (0.9, 0.03), strict=True):
            runs = np.repeat(random.random(len(time) // 12 + 1) < share, 12)[: len(time)]
            why = random.integers(5, size=len(time))
            places[side] = random.uniform(1.0, 199.0, (len(time), 2))
            sure = random.uniform(LIMIT, 1.0, len(time))
            shown = places[side].copy()
            for number, value in enumerate((np.nan, 0.0, -1.0, -32768.0)):
                shown[runs & (why == number)] = value
            sure[runs & (why == 4)] = random.uniform(0.3, LIMIT - 0.01)
            seen[side] = ~runs
            columns += [shown[:, 1], sure, shown[:, 0]]
            channels += [Channel(f"{side}_gaze_y", "px"), Channel(f"{side} confidence"),
                         Channel(f"{side}_gaze_x", "px")]  # fmt: skip
        about = {"coordinate_system": "screen"}
        header = StreamHeader("eyes", "Gaze", tuple(channels), "double64", 60.0, "eyes", about)
        write_stream(writer, header, time, 99.0, np.column_stack(columns))

    path = record(
        study(folder, MONITORED), folder / "data", "P001", gaze=["cab"], stated=(), also=write
    )
    return Truth(open_recording(path).session(1), path, made["time"], seen, places)


def test_gaze_is_known_where_an_eye_that_is_asked_for_is(truth: Truth) -> None:
    left, right = (truth.seen[side] for side in SIDES)
    expected = {"left": left, "right": right, "best": right, "mean": left | right}
    called = {"left": "left", "right": "right", "best": "right", "mean": "left and right"}
    shares = {}
    for eye, known in expected.items():
        found = looks(truth.session, eye=eye)
        assert found is not None
        np.testing.assert_array_equal(found.tracked, known)
        assert found.eyes == called[eye]
        table = measure_session(truth.session, MeasureSettings(gaze_eye=eye))
        assert set(table["gaze_eyes"]) == {called[eye]}
        shares[eye] = table["gaze_valid_during"].mean()
        assert shares[eye] == pytest.approx(known.mean(), abs=0.1)
    assert shares["left"] < shares["right"] <= shares["mean"]


def test_the_place_of_both_eyes_is_the_mean_of_those_that_see(truth: Truth) -> None:
    from labcrane.analysis.gaze_streams import window_gaze

    spots = window_gaze(truth.session, truth.session.streams["eyes"]).spots()
    for at in range(0, len(spots), 7):
        there = [truth.places[side][at] for side in SIDES if truth.seen[side][at]]
        expected = np.mean(there, axis=0) if there else [np.nan, np.nan]
        np.testing.assert_allclose(spots[at], expected)


def test_an_eye_that_is_not_there_is_refused_in_words(truth: Truth, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="there is no gaze_eye 'lft'; there is left, right, best"):
        MeasureSettings(gaze_eye="lft")
    path = record(study(tmp_path), tmp_path / "data", "P001", gaze=["cab"])
    one = open_recording(path).session(1)
    with pytest.raises(RecordingError, match=r"'eyes' does not have the left eye alone; it has bo"):
        looks(one, eye="left")
    (person,) = find_cohort(truth.path.parents[1]).included
    assert "eyes by which gaze was measured" in codebook_of(person, measures_of(person)).to_csv()


WAYS = (
    "{side}_x",
    "x_{side}",
    "{side}X",
    "{side} Gaze X",
    "Gaze{Side}X",
    "{SIDE}X",
    "{side}.por.x",
)


@pytest.mark.parametrize("seed", range(10))
def test_eyes_are_found_by_the_labels_of_any_tracker_in_any_order(seed: int) -> None:
    random = default_rng(seed)
    way = str(random.choice(WAYS))
    labels = {}
    for side in random.permutation(["left", "right"]):
        x = way.format(side=side, Side=side.capitalize(), SIDE=side.upper())
        labels |= {x: (side, "x"), _down(x): (side, "y"), f"{side}_pupil_diameter": (side, "p"),
                   f"{side} pupil x": ("", ""), f"Confidence {side}": (side, "c")}  # fmt: skip
    labels |= {"aoi": ("", ""), "max": ("", ""), "index": ("", "")}
    order = [str(label) for label in random.permutation(list(labels))]
    found = {eye.side: eye for eye in eyes_of([SignalChannel(label, "px") for label in order])}
    assert set(found) == {"left", "right"}
    for side, eye in found.items():
        assert labels[order[eye.x]] == (side, "x")
        assert labels[order[eye.y]] == (side, "y")
        assert eye.pupil is not None
        assert labels[order[eye.pupil]] == (side, "p")
        assert [labels[order[at]] for at in eye.confidence] == [(side, "c")]


def _down(across: str) -> str:
    at = max(across.rfind("x"), across.rfind("X"))
    return across[:at] + {"x": "y", "X": "Y"}[across[at]] + across[at + 1 :]


@pytest.mark.parametrize(
    ("labels", "place"),
    [
        (["confidence", "x", "y"], (1, 2)),
        (["Gaze X", "Gaze Y", "Pupil"], (0, 1)),
        (["norm_pos_x", "norm_pos_y", "gaze_point_3d_x", "gaze_point_3d_y"], (0, 1)),
        (["aoi", "max"], None),
        (["x", "left_y"], None),
        ([""], None),
    ],
)
def test_a_place_is_the_first_x_with_its_y(
    labels: list[str], place: tuple[int, int] | None
) -> None:
    found = eyes_of([SignalChannel(label) for label in labels])
    assert [(eye.x, eye.y) for eye in found] == ([] if place is None else [place])


def test_pixels_per_degree_are_no_place_of_an_eye() -> None:
    """An EyeLink's own program sends them beside both eyes; they were a third, cyclopean one."""
    labels = ("leftEyeX", "leftEyeY", "rightEyeX", "rightEyeY", "leftPupilArea", "rightPupilArea")
    degrees = ("pixelsPerDegreeX", "pixelsPerDegreeY")
    eyes = eyes_of([SignalChannel(label, "pixels") for label in (*labels, *degrees)])
    assert [(eye.side, eye.x, eye.y, eye.pupil) for eye in eyes] == [
        ("left", 0, 1, 4),
        ("right", 2, 3, 5),
    ]


@pytest.mark.parametrize("seed", range(4))
def test_an_area_that_the_tracker_is_not_sure_of_is_not_looked_at(seed: int) -> None:
    random = default_rng(seed)
    time = np.arange(0.0, 3.0, 0.01)
    area = random.choice(["target", "", "crane"], len(time)).tolist()
    tracked = random.random(len(time)) < 0.5
    found = Looks(time, area, tracked, ["target", "crane"])
    known = [at for at, name in enumerate(area) if name == "target" and tracked[at]]
    assert found.dwell("target", [(0.0, 3.0)]) == pytest.approx(0.01 * len(known))
    assert found.first("target", 0.0, 3.0) == pytest.approx(time[known[0]])
