"""One XDF file with all streams on one clock."""

import json
import logging
from pathlib import Path

import numpy as np
import pytest
import pyxdf

from labcrane.analysis.cohort import Cohort
from labcrane_xdf.merged import SIDECAR, MergedXdf


@pytest.fixture(scope="module")
def folder(electrodes: Cohort, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("xdf")
    MergedXdf().export(electrodes.included, out)
    return out


def test_pyxdf_opens_all_streams_on_corrected_clocks_and_has_no_complaint(
    folder: Path, electrodes: Cohort, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING):
        streams, _ = pyxdf.load_xdf(folder / "P001_ses-01.xdf", dejitter_timestamps=False)
    assert caplog.records == []
    read = {stream["info"]["name"][0]: stream for stream in streams}
    _, session = next(electrodes.included[0].sessions())
    foreign = {"eyes", "BrainAmp", "Heart"}
    for name, stream in session.streams.items():
        found = read.pop(name if name in foreign else f"labcrane.{name}")
        np.testing.assert_array_equal(found["time_stamps"], stream.time)
        np.testing.assert_array_equal(found["time_series"], stream.data.to_numpy())
        channels = found["info"]["desc"][0]["channels"][0]["channel"]
        assert [channel["label"][0] for channel in channels] == list(stream.data)
        assert [channel["unit"][0] or "" for channel in channels] == list(stream.units.values())
        if name == "eyes":  # one clock, though the eyes' own is 5000 s behind
            assert found["time_stamps"][0] < session.streams["state"].time[0]
    assert set(read) == {"labcrane.names", "labcrane.labels", "labcrane.markers"}


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
