"""One XDF file with all streams on one clock."""

import json
import logging
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import numpy as np
import pytest
import pyxdf

from labcrane.analysis.cohort import Cohort
from labcrane.recording import Stream
from labcrane_xdf.merged import SIDECAR, MergedXdf, _steady
from results.recorded import EEG_HZ


@pytest.fixture(scope="module")
def folder(electrodes: Cohort, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("xdf")
    MergedXdf().export(electrodes.included, out)
    return out


def test_pyxdf_opens_all_streams_on_corrected_clocks_and_has_no_complaint(
    folder: Path, electrodes: Cohort, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING):
        streams, _ = pyxdf.load_xdf(folder / "P001_ses-01.xdf")
    assert caplog.records == []
    read = {stream["info"]["name"][0]: stream for stream in streams}
    _, session = next(electrodes.included[0].sessions())
    foreign = {"eyes", "BrainAmp", "Heart"}
    for name, stream in session.streams.items():
        found = read.pop(name if name in foreign else f"labcrane.{name}")
        np.testing.assert_allclose(found["time_stamps"], stream.time, rtol=0, atol=1e-5)
        np.testing.assert_array_equal(found["time_series"], stream.data.to_numpy())
        channels = found["info"]["desc"][0]["channels"][0]["channel"]
        assert [channel["label"][0] for channel in channels] == list(stream.data)
        assert [channel["unit"][0] or "" for channel in channels] == list(stream.units.values())
        if name == "eyes":  # one clock, though the eyes' own is 5000 s behind
            assert found["time_stamps"][0] < session.streams["state"].time[0]
    assert set(read) == {"labcrane.names", "labcrane.labels", "labcrane.markers"}


def test_a_hole_of_0_4_s_moves_no_stamp_by_a_sample_in_pyxdf_as_it_is(
    folder: Path, electrodes: Cohort
) -> None:
    """pyxdf puts one line through the stamps of a regular stream, over holes of less than 1 s."""
    streams, _ = pyxdf.load_xdf(folder / "P001_ses-01.xdf", select_streams=[{"name": "BrainAmp"}])
    _, session = next(electrodes.included[0].sessions())
    time = session.streams["BrainAmp"].time
    assert np.diff(time).max() > 0.4
    assert np.abs(streams[0]["time_stamps"] - time).max() < 1e-9
    about = streams[0]["info"]
    assert float(about["nominal_srate"][0]) == 0.0
    assert float(about["desc"][0]["labcrane"][0]["nominal_srate"][0]) == EEG_HZ


@pytest.mark.parametrize("seed", range(5))
def test_a_stream_states_its_rate_as_long_as_a_line_through_its_stamps_is_right(seed: int) -> None:
    draws = np.random.default_rng(seed)
    rate_hz = float(draws.uniform(50.0, 2000.0))
    time = 1e5 + np.arange(20_000) / rate_hz * (1.0 + draws.uniform(-1e-4, 1e-4))
    time += draws.uniform(-0.4, 0.4, len(time)) / rate_hz
    assert _steady(stamped(time), rate_hz) == rate_hz
    time[draws.integers(2000, 18_000) :] += 8.0 / rate_hz
    assert _steady(stamped(time), rate_hz) == 0.0
    assert _steady(stamped(time[:2]), rate_hz) == rate_hz


def stamped(time: np.ndarray) -> Stream:
    """Return what of a stream says when its samples were."""
    return cast(Stream, Stamps(time))


@dataclass
class Stamps:
    """A stream that has nothing but its time."""

    time: np.ndarray

    def __len__(self) -> int:
        return len(self.time)

    def column(self, name: str) -> np.ndarray:
        return {"time": self.time}[name]


def test_what_a_source_says_of_itself_is_said_again(folder: Path) -> None:
    streams, _ = pyxdf.load_xdf(folder / "P001_ses-01.xdf")
    read = {stream["info"]["name"][0]: stream["info"] for stream in streams}
    channels = read["BrainAmp"]["desc"][0]["channels"][0]["channel"]
    assert [each["type"][0] for each in channels] == ["EEG", "EEG", "EOG", "Trigger"]
    assert read["BrainAmp"]["source_id"] == ["amp"]
    assert float(read["Heart"]["nominal_srate"][0]) == 100.0
    (told,) = read["BrainAmp"]["desc"]
    assert told["acquisition"][0]["manufacturer"] == ["Somebody"]
    assert "synchronization" not in told, "what its stamps needed has been done"


def test_numbers_keep_the_format_in_which_they_were_sent(folder: Path) -> None:
    streams, _ = pyxdf.load_xdf(folder / "P001_ses-01.xdf")
    forms = {stream["info"]["name"][0]: stream["time_series"] for stream in streams}
    assert forms["BrainAmp"].dtype == np.float32
    assert forms["Heart"].dtype == np.int16
    assert forms["eyes"].dtype == forms["labcrane.state"].dtype == np.float64


def test_markers_are_few_names_to_epoch_by_and_labels_with_block_and_condition(
    folder: Path, electrodes: Cohort
) -> None:
    streams, _ = pyxdf.load_xdf(folder / "P001_ses-01.xdf")
    read = {stream["info"]["name"][0]: stream for stream in streams}
    _, session = next(electrodes.included[0].sessions())
    events = session.events.sort_values("time", kind="stable")
    names = [text for (text,) in read["labcrane.names"]["time_series"]]
    labels = [text for (text,) in read["labcrane.labels"]["time_series"]]
    texts = [json.loads(text) for (text,) in read["labcrane.markers"]["time_series"]]
    assert names == [name.replace(".", "_") for name in events["name"]]
    assert [text["event"] for text in texts] == list(events["name"])
    for stream in ("names", "labels", "markers"):
        np.testing.assert_array_equal(read[f"labcrane.{stream}"]["time_stamps"], events["time"])
    assert len(set(names)) < 15
    starts = [
        (label, text) for label, text in zip(labels, texts, strict=True)
        if text["event"] == "trial.start"
    ]  # fmt: skip
    for label, text in starts:
        condition = f"pair={text['pair']}/far_side={text['far_side']}/direction={text['direction']}"
        uncounted = "" if text["counted"] else "uncounted/"
        assert label == f"trial_start/block=aiming/{uncounted}{condition}"
    assert {text["counted"] for _, text in starts} == {True, False}
    ends = [label for label in labels if label.startswith("trial_end/")]
    assert [end.replace("end", "start", 1).removesuffix("/outcome=success") for end in ends] == [
        label for label, _ in starts
    ]
    assert all(len(text) < 20 or text["event"] != "session.start" for text in texts)
    sidecar = json.loads((folder / SIDECAR).read_text(encoding="utf-8"))
    assert set(sidecar["label"]["HED"]) == set(sidecar["label"]["Levels"]) == set(names)
