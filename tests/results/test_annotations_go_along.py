"""Marks that people made go along: into every export, the report, MNE, and through `resync`."""

import json
import shutil
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import pyxdf
from needs import needs
from programs import ran
from scipy.io import loadmat

from labcrane import open_recording
from labcrane.analysis.cohort import Cohort
from labcrane.recording import annotate, withdraw
from labcrane.testing import main
from results.undrawn import without_figures

TEXTS = ("looked at the phone", "BAD_movement of the head", "„krumm“, with\na second line")


@pytest.fixture(scope="module")
def marked(electrodes: Cohort, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a data folder with three marks in its one session, and one that was taken back."""
    data = tmp_path_factory.mktemp("marked") / "data"
    shutil.copytree(electrodes.folder, data)
    file = data / "P001" / "P001.h5"
    zero = open_recording(file).session(1).streams["state"].time[0]
    for at, text in zip((20.0, 5.0, 11.5), TEXTS, strict=True):
        annotate(file, 1, zero + at, text, zero + at + 2.25)
    withdraw(file, 1, annotate(file, 1, zero + 1.0, "a slip").number)
    return data


def export(data: Path, to: str, out: Path) -> Path:
    assert main(["export", str(data), "--to", to, "--out", str(out)]) == 0
    return out


@pytest.mark.slow
def test_every_exporter_that_has_events_has_the_marks_too(marked: Path, tmp_path: Path) -> None:
    record = open_recording(marked / "P001" / "P001.h5").session(1)
    zero = record.streams["state"].time[0]
    wanted = [(5.0, TEXTS[1]), (11.5, TEXTS[2]), (20.0, TEXTS[0])]
    tables = pd.read_csv(export(marked, "tables", tmp_path / "tables") / "annotations.csv")
    assert tables[["at", "text"]].to_numpy().tolist() == [
        [pytest.approx(at), text] for at, text in wanted
    ]
    assert tables["time"].to_numpy() - zero == pytest.approx([5.0, 11.5, 20.0])

    folder = export(marked, "bids", tmp_path / "bids")
    for kind in ("motion", "eeg"):
        (path,) = folder.glob(f"sub-*/ses-01/{kind}/*_events.tsv")
        events = pd.read_csv(path, sep="\t", na_values="n/a")
        rows = events[events["trial_type"] == "annotation"]
        assert rows["annotation"].tolist() == [" ".join(text.split()) for _, text in wanted]
        assert rows["duration"].tolist() == pytest.approx([2.25] * 3)
        if kind == "motion":
            assert rows["onset"].tolist() == pytest.approx([5.0, 11.5, 20.0])
    assert events["onset"].is_monotonic_increasing

    streams, _ = pyxdf.load_xdf(export(marked, "xdf", tmp_path / "xdf") / "P001_ses-01.xdf")
    (found,) = [one for one in streams if one["info"]["name"][0] == "labcrane.annotations"]
    assert found["time_series"] == [[text, "2.25"] for _, text in wanted]
    np.testing.assert_allclose(found["time_stamps"] - zero, [5.0, 11.5, 20.0], atol=1e-9)

    content = loadmat(export(marked, "matlab", tmp_path / "matlab") / "P001.mat",
                      simplify_cells=True)["labcrane"]  # fmt: skip
    marks = content["sessions"]["annotations"]
    assert list(marks["text"]) == [text for _, text in wanted]
    assert marks["time"] - zero == pytest.approx([5.0, 11.5, 20.0])


@pytest.mark.slow
def test_the_report_lists_marks_and_the_page_of_somebody_without_any_says_nothing(
    marked: Path, electrodes: Cohort, tmp_path: Path
) -> None:
    for data, there in ((marked, True), (electrodes.folder, False)):
        out = tmp_path / str(there)
        with without_figures():
            assert main(["report", str(data), "--out", str(out)]) == 0
        page = (out / "participants" / "P001.html").read_text("utf-8")
        assert ("looked at the phone" in page) is there
        assert ("Annotations made in the viewer" in page) is there
        assert "a slip" not in page


@pytest.mark.slow
def test_marks_outlive_that_clocks_are_corrected_anew_and_the_file_is_made_anew(
    marked: Path, tmp_path: Path
) -> None:
    data = tmp_path / "data"
    shutil.copytree(marked, data)
    file = data / "P001" / "P001.h5"
    before = open_recording(file).session(1).annotations
    assert len(before) == 3
    assert main(["resync", str(file)]) == 0
    assert open_recording(file).session(1).annotations.equals(before)
    file.unlink()
    assert main(["recover", str(data)]) == 0
    assert open_recording(file).session(1).annotations.equals(before)


@pytest.mark.long
@needs("mne")
def test_mne_has_the_marks_at_their_samples_and_leaves_out_what_was_marked_bad(
    marked: Path,
) -> None:
    code = (
        "import sys\nfrom labcrane import open_recording\n"
        "from labcrane.analysis.electrodes.mne import to_mne\n"
        "raw = to_mne(open_recording(sys.argv[1]).session(1))\n"
        "import json\n"
        "print(json.dumps([a['description'] for a in raw.annotations"
        " if abs(a['duration'] - 2.25) < 0.001]))"
    )
    file = marked / "P001" / "P001.h5"
    done = ran([sys.executable, "-c", code, str(file)], check=True)
    texts = json.loads(done.stdout.splitlines()[-1])
    assert texts == [TEXTS[1], f"annotation/{TEXTS[2]}", f"annotation/{TEXTS[0]}"]
