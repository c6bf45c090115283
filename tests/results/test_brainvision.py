"""BrainVision files, beside those of the published writer."""

from pathlib import Path

import numpy as np
import pytest
from needs import needs

from labcrane import RecordingError
from labcrane_bids.brainvision import write_brainvision

CHANNELS = [("Fz", "µV"), ("a, b", "µV")]
NAMES = ("ours", "theirs")
MARKERS = [(0, 1, "trial_start"), (9_999, 1, "trial_end")]


@needs("pybv")
def test_what_is_written_by_pieces_is_what_pybv_writes_at_once(tmp_path: Path) -> None:
    import pybv

    data = np.random.default_rng().standard_normal((10_000, 2)).astype(np.float32)
    pieces = (data[at : at + 777].astype(float) for at in range(0, len(data), 777))
    (tmp_path / "ours").mkdir()
    write_brainvision(tmp_path / "ours" / "x_eeg", pieces, 250.0, CHANNELS, MARKERS)
    pybv.write_brainvision(
        data=1e-6 * data.T.astype(float), sfreq=250.0, ch_names=[name for name, _ in CHANNELS],
        fname_base="x_eeg", folder_out=tmp_path / "theirs", resolution=1.0, unit="µV",
        events=[{"onset": at, "description": text, "type": "Comment"} for at, _, text in MARKERS],
    )  # fmt: skip
    ours, theirs = ((tmp_path / name / "x_eeg.eeg").read_bytes() for name in NAMES)
    np.testing.assert_array_equal(np.frombuffer(ours, "<f4"), data.ravel())
    np.testing.assert_allclose(
        np.frombuffer(ours, "<f4"), np.frombuffer(theirs, "<f4"), rtol=1e-6
    )  # through volts and back, a last digit may go
    for ending in ("vhdr", "vmrk"):
        texts = [(tmp_path / name / f"x_eeg.{ending}").read_text("utf-8") for name in NAMES]
        said = [
            [line for line in text.split("\n") if line and not line.startswith(";")]
            for text in texts
        ]
        assert said[0] == said[1]


def test_a_number_beyond_the_format_is_refused_in_words(tmp_path: Path) -> None:
    for fine in (np.nan, np.inf, 3e38):
        write_brainvision(tmp_path / "x", [np.array([[fine]])], 1.0, CHANNELS[:1], [])
    with pytest.raises(RecordingError, match=r"x has a number beyond 3\.4e\+38, which BrainVision"):
        write_brainvision(tmp_path / "x", [np.array([[1e39]])], 1.0, CHANNELS[:1], [])
