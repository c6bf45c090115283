"""Gaze in pixels is measured only where somebody says that they are the window's."""

import shutil
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import h5py
import pandas as pd
import pytest

from labcrane import RecordingError, open_recording
from labcrane.analysis import find_cohort, gaze_space
from labcrane.analysis.gaze import looks
from labcrane.analysis.gaze_streams import unmeasured, window_stream
from labcrane.analysis.measures import MeasureSettings, measure_session
from labcrane.analysis.report.report import write_report
from labcrane.recording import Channel, SessionRecord, Stream, StreamHeader
from labcrane.testing import main
from labcrane.web.viewer.glances import Glances
from results.recorded import STUDY, record, study
from results.undrawn import without_figures


def resync(path: Path, *declared: str) -> int:
    return main(["resync", str(path), *(word for each in declared for word in ("--space", each))])


def first(path: Path) -> SessionRecord:
    return open_recording(path).session(1)


def glanced(session: SessionRecord) -> bool:
    return Glances(session, session.streams["state"].time[0]).known


@pytest.fixture(scope="module")
def unstated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("unstated")
    return record(study(folder), folder / "data", "P001", gaze=["cab"], stated=["", "world"])


def test_pixels_of_which_nobody_says_of_what_are_measured_nowhere(unstated: Path) -> None:
    session = first(unstated)
    assert looks(session) is None
    assert window_stream(session) is None
    assert not glanced(session)
    why = dict(unmeasured(session))
    assert why["eyes"] == (
        "is in pixels, but neither the protocol nor its header states of which picture; for the "
        "participant's window, declare it with labcrane resync FILE --space 'eyes=screen'; for a "
        "scene camera, 'eyes=scene'"
    )
    assert why["glasses"].startswith("is in pixels of a scene camera, which moves with the head")


@pytest.mark.slow
def test_a_report_says_which_gaze_it_does_not_measure_and_how_to_declare_it(
    unstated: Path, tmp_path: Path
) -> None:
    with without_figures():
        write_report(find_cohort(unstated.parents[1]), tmp_path)
    told = pd.read_csv(tmp_path / "tables" / "unmeasured_gaze.csv")
    assert told[["participant", "session", "stream"]].to_numpy().tolist() == [
        ["P001", 1, "eyes"],
        ["P001", 1, "glasses"],
    ]
    assert told["why"].tolist() == [why for _, why in unmeasured(first(unstated))]
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "labcrane resync FILE --space" in page
    measured = pd.read_csv(tmp_path / "tables" / "movements.csv")
    assert not [name for name in measured if name.startswith(("dwell_", "look_lead_"))]


@pytest.mark.slow
def test_what_pixels_are_of_can_be_declared_afterwards_and_taken_back(
    unstated: Path, tmp_path: Path
) -> None:
    path = Path(shutil.copy(unstated, tmp_path / "P001.h5"))
    resync(path, "eyes=screen")
    session = first(path)
    seen = looks(session)
    assert seen is not None
    assert "target" in set(seen.area)
    assert glanced(session)
    assert [name for name, _ in unmeasured(session)] == ["glasses"]
    resync(path)
    assert looks(first(path)) is not None, "a new correction keeps what was declared"
    resync(path, "eyes=scene", "glasses=scene")
    assert looks(first(path)) is None


@pytest.mark.slow
def test_of_two_streams_that_could_be_measured_none_is_until_one_is_named(
    unstated: Path, tmp_path: Path
) -> None:
    path = Path(shutil.copy(unstated, tmp_path / "P001.h5"))
    resync(path, "eyes=screen", "glasses=screen")
    session = first(path)
    assert looks(session) is None
    assert [name for name, _ in unmeasured(session)] == ["eyes", "glasses"]
    assert unmeasured(session)[0][1].startswith(
        "could be measured as well as others: 'eyes' and 'glasses'; choose one"
    )
    assert "dwell_during_target" in measure_session(session, MeasureSettings(gaze_stream="eyes"))
    with pytest.raises(RecordingError, match=r"by a stream 'eye'; did you mean 'eyes'\? there"):
        looks(session, stream="eye")


def test_a_declaration_that_cannot_be_is_refused_and_changes_nothing(
    unstated: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = unstated.read_bytes()
    assert resync(unstated, "eye=screen") == 1
    assert "has no gaze stream 'eye'; did you mean 'eyes'? there is eyes" in words(capsys)
    assert resync(unstated, "eyes=window") == 1
    assert (
        "--space eyes=window: gaze is in pixels of the participant's window (screen) or of a scene "
        "camera (scene)"
    ) in words(capsys)
    assert unstated.read_bytes() == before


def words(capsys: pytest.CaptureFixture[str]) -> str:
    captured = capsys.readouterr()
    return " ".join((captured.out + captured.err).split())


@pytest.mark.parametrize(
    ("stated", "is_in"),
    [
        ("world", "scene"), ("scene-camera", "scene"), ("World_Camera", "scene"),
        ("screen", "screen"), ("gaze-on-screen", "screen"), ("Display", "screen"),
        ("", ""), ("head", ""), ("screen of the world", ""),
    ],
)  # fmt: skip
def test_a_header_states_the_space_at_its_channels_or_once(stated: str, is_in: str) -> None:
    channels = (Channel("x", "px", extra={"coordinate_system": stated}), Channel("y", "px"))
    at_channel = StreamHeader("eyes", "Gaze", channels)
    once = StreamHeader("eyes", "Gaze", (Channel("x", "px"),), desc={"coordinate_system": stated})
    for header in (at_channel, once):
        assert gaze_space(cast(Stream, SimpleNamespace(attrs={}, header=header))) == is_in
        declared = SimpleNamespace(attrs={"space": "screen"}, header=header)
        assert gaze_space(cast(Stream, declared)) == "screen"


VIEWED = STUDY.replace(
    "tasks:\n",
    "views:\n"
    "  aside: {use: view, seen_by: examiner, camera: free}\n"
    "  cab: {use: view, camera: cab}\n"
    "tasks:\n",
    1,
)


def with_second_view(path: Path, folder: Path, name: str) -> SessionRecord:
    """Return the recording with the areas of another view, which has all of them elsewhere."""
    copied = Path(shutil.copy(path, folder / "P001.h5"))
    with h5py.File(copied, "r+") as file:
        streams = file["ses-01/streams"]
        streams.copy("labcrane.feedback.cab.areas", f"labcrane.feedback.{name}.areas")
        other = streams[f"labcrane.feedback.{name}.areas"]
        other.attrs["name"] = f"labcrane.feedback.{name}.areas"
        for column in other["data"].values():
            column[...] = column[...] + 5000.0
    return first(copied)


@pytest.fixture(scope="module")
def viewed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("viewed")
    return record(study(folder, VIEWED), folder / "data", "P001", gaze=["cab"])


def test_gaze_is_joined_to_the_operators_view_and_not_to_the_examiners(
    viewed: Path, tmp_path: Path
) -> None:
    session = with_second_view(viewed, tmp_path, "aside")
    alone, beside = looks(first(viewed)), looks(session)
    assert alone is not None
    assert beside is not None
    assert list(beside.area) == list(alone.area)
    assert {"target", ""} == set(beside.area)
    start = session.streams["state"].time[0]
    shown = Glances(session, start).at(1.0).areas
    assert shown == Glances(first(viewed), start).at(1.0).areas
    assert not unmeasured(session)


def test_gaze_is_measured_on_none_of_two_views_of_the_operator_and_the_record_says_so(
    viewed: Path, tmp_path: Path
) -> None:
    session = with_second_view(viewed, tmp_path, "boom")
    assert looks(session) is None
    assert not glanced(session)
    assert unmeasured(session) == [
        (
            "eyes",
            "is in pixels of the window, but it is unknown of which view ('boom' and 'cab'); "
            "join it manually with labcrane.analysis.gaze.looks_on_screen (docs/devices.md)",
        )
    ]
