"""One XDF file with all streams on one clock."""

import json
from pathlib import Path

import numpy as np
import pyxdf

from labcrane.analysis.cohort import Cohort
from labcrane_xdf.merged import MergedXdf


def test_pyxdf_opens_all_streams_on_corrected_clocks(cohort: Cohort, tmp_path: Path) -> None:
    MergedXdf().export(cohort.included[:1], tmp_path)
    streams, _ = pyxdf.load_xdf(tmp_path / "P001_ses-01.xdf", dejitter_timestamps=False)
    read = {stream["info"]["name"][0]: stream for stream in streams}
    _, session = next(cohort.included[0].sessions())
    for name, stream in session.streams.items():
        found = read[name if name == "eyes" else f"labcrane.{name}"]
        np.testing.assert_array_equal(found["time_stamps"], stream.time)
        np.testing.assert_array_equal(found["time_series"], stream.data.to_numpy())
        channels = found["info"]["desc"][0]["channels"][0]["channel"]
        assert [channel["label"][0] for channel in channels] == list(stream.data)
        assert [channel["unit"][0] or "" for channel in channels] == list(stream.units.values())
    eyes, state = read["eyes"]["time_stamps"], read["labcrane.state"]["time_stamps"]
    assert eyes[0] < state[0] < state[-1]  # one clock, though the eyes' own is 5000 s behind
    texts = [json.loads(text) for (text,) in read["labcrane.markers"]["time_series"]]
    assert sum(text["event"] == "trial.end" for text in texts) == 12
