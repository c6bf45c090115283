"""EEG on the session's clock: for MNE, and in BIDS."""

import json
import warnings
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from docs.page import blocks
from needs import needs

from labcrane import RecordingError
from labcrane.analysis import sampled, to_mne, volts
from labcrane.analysis.cohort import Cohort
from labcrane.core import HED_VERSION
from labcrane.core.events import KINDS
from labcrane.recording import SessionRecord
from labcrane.testing import ch8
from labcrane_bids.bids import Bids
from labcrane_bids.events import event_description
from labcrane_bids.settings import BidsSettings
from results.consumers import bids_errors
from results.recorded import EEG_HZ, LOST

NAME = "sub-P001_ses-01_task-acquisition"
RECIPES = Path(__file__).parents[2] / "docs" / "recipes.md"
FOLDER = Path("sub-P001") / "ses-01"


@pytest.fixture(scope="module")
def session(electrodes: Cohort) -> SessionRecord:
    _, session = next(electrodes.included[0].sessions())
    return session


@pytest.fixture(scope="module")
def bids(electrodes: Cohort, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("bids")
    asked = tmp_path_factory.mktemp("asked")
    (asked / "tlx.csv").write_text("participant,mental\nP001,35\n", encoding="utf-8")
    (asked / "tlx.json").write_text('{"mental": {"Units": "1"}}', encoding="utf-8")
    settings = BidsSettings(eeg_reference="FCz", power_line_hz=50.0, phenotype=asked)
    Bids(settings, ch8()).export(iter(electrodes.included), out)
    return out


def test_every_event_is_at_the_sample_that_has_its_pulse(session: SessionRecord) -> None:
    """The source's clock is 777 s off and 40 ppm slow, and 50 of its samples never came."""
    signal = sampled(session.streams["BrainAmp"])
    positions = signal.at(session.events["time"].to_numpy())
    assert len(positions) > 80
    at = np.rint(positions).astype(int)
    assert set(at) == set(np.flatnonzero(signal.data[:, 3] == 1.0))
    assert signal.rate_hz == EEG_HZ
    assert signal.holes.tolist() == [[LOST.start, LOST.stop]]


def test_what_happened_outside_of_the_recording_is_at_no_sample(session: SessionRecord) -> None:
    signal = sampled(session.streams["BrainAmp"])
    around = np.array([signal.time[0] - 1.0, signal.time[0], signal.time[-1], signal.time[-1] + 1])
    np.testing.assert_array_equal(signal.at(around), [np.nan, 0.0, len(signal) - 1, np.nan])


def test_what_cannot_be_put_at_samples_is_refused_in_words(session: SessionRecord) -> None:
    with pytest.raises(RecordingError, match=r"'state' is one of the session's own, or its clock"):
        sampled(session.streams["state"])
    amp = session.streams["BrainAmp"]
    signal = sampled(amp)
    none = replace(signal, units=("", "", "", ""))
    with pytest.raises(RecordingError, match=r"'Fz' states no unit; give the one of its source"):
        volts(none, amp)
    np.testing.assert_allclose(volts(none, amp, "mV"), [1e-3, 1e-3, 1e-3, 1.0])
    with pytest.raises(RecordingError, match=r"'Fz' is not a voltage: '1 degC' "):
        volts(none, amp, "degC")


def test_events_of_eeg_and_of_motion_are_the_same_on_two_clocks(
    bids: Path, session: SessionRecord
) -> None:
    motion = pd.read_csv(bids / FOLDER / "motion" / f"{NAME}_events.tsv", sep="\t")
    eeg = pd.read_csv(bids / FOLDER / "eeg" / f"{NAME}_events.tsv", sep="\t")
    scans = pd.read_csv(bids / FOLDER / f"{NAME.partition('_task')[0]}_scans.tsv", sep="\t")
    when = pd.to_datetime(scans.set_index("filename")["acq_time"])
    later = when[f"eeg/{NAME}_eeg.vhdr"] - when[f"motion/{NAME}_tracksys-crane_motion.tsv"]
    signal = sampled(session.streams["BrainAmp"])
    zero = session.streams["state"].time[0]
    assert later.total_seconds() == pytest.approx(signal.time[0] - zero, abs=2e-6)
    (gap,) = eeg.index[eeg["trial_type"] == "BAD_boundary"]
    assert eeg["sample"][gap] == LOST.start
    assert eeg["duration"][gap] == (LOST.stop - LOST.start) / EEG_HZ
    own = eeg.drop(index=gap).reset_index(drop=True)
    assert own["trial_type"].tolist() == motion["trial_type"].tolist()
    # Both are the same but for where they begin, 40 ppm, and half a sample beyond the last.
    moved = own["onset"] + signal.time[0] - zero - motion["onset"]
    assert np.abs(moved).max() < 40e-6 * (motion["onset"].max() + 5.0) + 0.5 / EEG_HZ
    about = json.loads((bids / FOLDER / "eeg" / f"{NAME}_eeg.json").read_text(encoding="utf-8"))
    assert (about["EEGReference"], about["PowerLineFrequency"]) == ("FCz", 50.0)
    assert about["RecordingType"] == "discontinuous"


def test_a_heart_is_physio_and_gaze_in_metres_is_in_the_world(bids: Path) -> None:
    stem = bids / FOLDER / "beh" / f"{NAME}_recording"
    heart = json.loads(Path(f"{stem}-Heart_physio.json").read_text(encoding="utf-8"))
    assert heart["Columns"] == ["timestamp", "ecg"]
    assert heart["ecg"]["Units"] == "millivolts"
    eyes = json.loads(Path(f"{stem}-eye1_physio.json").read_text(encoding="utf-8"))
    assert eyes["SampleCoordinateSystem"] == "gaze-in-world"


@pytest.mark.slow
@needs("bids-validator-deno")
def test_the_validator_finds_no_error_in_eeg_motion_physio_and_phenotype(bids: Path) -> None:
    assert bids_errors(bids) == []


@pytest.mark.slow
@needs("bids-validator-deno")
def test_the_validator_knows_the_tags_of_every_event_also_of_two_at_once(tmp_path: Path) -> None:
    folder = tmp_path / "sub-1" / "beh"
    folder.mkdir(parents=True)
    about = {"Name": "tags", "BIDSVersion": "1.11.1", "HEDVersion": HED_VERSION}
    (tmp_path / "dataset_description.json").write_text(json.dumps(about), encoding="utf-8")
    (tmp_path / "README").write_text("tags", encoding="utf-8")
    names = [*(kind.label for kind in KINDS.values()), "contact_object", "somebody_else"]
    table = pd.DataFrame(
        {"onset": 1.0, "duration": 0.0, "trial_type": names, "label": names,
         "repeat": ["n/a"] * len(KINDS) + ["2", "n/a"]}
    )  # fmt: skip
    columns = {
        key: value for key, value in event_description(table, {}, {}).items() if key in table
    }
    path = folder / "sub-1_task-a_events.json"
    path.write_text(json.dumps({**columns, "TaskName": "a"}), encoding="utf-8")
    table.to_csv(path.with_suffix(".tsv"), sep="\t", index=False)
    assert bids_errors(tmp_path) == []
    table.assign(repeat="n/a").to_csv(path.with_suffix(".tsv"), sep="\t", index=False)
    assert [each.split()[0] for each in bids_errors(tmp_path)] == ["HED_ERROR"], "it does look"


@pytest.mark.slow
@needs("mne", "mne_bids")
def test_mne_reads_the_participant_file_and_bids_alike_and_epochs_by_label(
    bids: Path, session: SessionRecord
) -> None:
    import mne_bids

    raw = to_mne(session)
    assert raw.get_channel_types() == ["eeg", "eeg", "eog", "stim"]
    signal = sampled(session.streams["BrainAmp"])
    there = np.isfinite(signal.data[:, 0])
    taken = raw.get_data()[:3].T
    np.testing.assert_allclose(taken[there], 1e-6 * signal.data[there, :3], rtol=1e-12)
    rows = np.arange(len(signal))
    for channel in taken.T:  # a straight line bridges what is missing
        line = np.interp(rows[~there], rows[there], channel[there])
        np.testing.assert_allclose(channel[~there], line, rtol=1e-9)
    assert not there[LOST].any()
    (fault,) = (each for each in raw.annotations if each["description"] == "fault/flat_line")
    assert fault["ch_names"] == ("Fz",)
    zero = signal.time[0]
    assert [zero + fault["onset"], fault["duration"]] == pytest.approx([110.0, 15.0], abs=0.5)
    recipe: dict[str, Any] = {}
    (text,) = (each.text for each in blocks(RECIPES) if "mne.Epochs" in each.text)
    exec(text, recipe)
    epochs_of = partial(
        recipe["epochs_of"], tmin=-0.1, tmax=0.1, baseline=None, picks="stim", preload=True,
        reject_by_annotation=False, verbose="error",
    )  # fmt: skip
    signal = sampled(session.streams["BrainAmp"])
    inside = np.isfinite(signal.at(session.events["time"].to_numpy() - 0.1))
    inside &= np.isfinite(signal.at(session.events["time"].to_numpy() + 0.1))
    there = session.events[inside]["name"].str.replace(".", "_").value_counts().to_dict()
    assert there["targets_shown"] == there["trial_start"] > 5
    assert {name: len(epochs_of(raw, name)) for name in there} == there
    entered = epochs_of(raw, "target_entered")
    inward = entered["target_entered/direction=inward"]
    assert len(entered) == 12
    assert 0 < len(inward) < len(entered)
    middle = round(0.1 * EEG_HZ)
    assert (entered.get_data(verbose="error")[:, 0, middle] == 1.0).all()
    assert "BAD_boundary" in set(raw.annotations.description)

    path = mne_bids.BIDSPath(
        root=bids, subject="P001", session="01", task="acquisition", datatype="eeg"
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # columns and tags that MNE has no use for
        again = mne_bids.read_raw_bids(path, verbose="error")
    np.testing.assert_allclose(again.get_data()[:3], raw.get_data()[:3], rtol=1e-6, atol=1e-15)
    assert again.info["line_freq"] == 50.0
    assert again.info["bads"] == [], "which channels are bad is for the analyst to say"
    channels = pd.read_csv(path.copy().update(suffix="channels", extension=".tsv").fpath, sep="\t")
    described = channels.set_index("name")["status_description"].dropna().to_dict()
    assert described == {"Fz": "flat line for 15.0 s"}
    assert {name: len(epochs_of(again, name)) for name in there} == there
    theirs = again.annotations.onset[again.annotations.description == "target_entered"]
    ours = [each["onset"] for each in raw.annotations
            if each["description"].startswith("target_entered/")]  # fmt: skip
    np.testing.assert_allclose(theirs, ours, atol=1e-6)
