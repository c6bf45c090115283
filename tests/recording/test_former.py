"""Recordings of former commits, of each kind: read, shown in a report, exported, scored, replayed.

``former/make.sh`` made them from the history; docs/compatibility.md promises what is tried here.
"""

import gzip
from pathlib import Path

import h5py
import numpy as np
import pytest

from labcrane import open_recording
from labcrane.analysis.measures import measure_session
from labcrane.cli.app import main

FORMER = Path(__file__).parent / "former"
NAMES = sorted(packed.name.partition(".")[0] for packed in FORMER.glob("*.h5.gz"))

pytestmark = pytest.mark.slow


@pytest.fixture(params=NAMES)
def recorded(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """Return a participant file in its place in a data folder."""
    packed = gzip.decompress((FORMER / f"{request.param}.h5.gz").read_bytes())
    (tmp_path / "packed.h5").write_bytes(packed)
    with h5py.File(tmp_path / "packed.h5") as file:
        name = str(file["ses-01"].attrs["participant"])
    place = tmp_path / "data" / name / f"{name}.h5"
    place.parent.mkdir(parents=True)
    (tmp_path / "packed.h5").rename(place)
    return place


def test_each_kind_of_recording_is_kept() -> None:
    assert NAMES == ["arm", "bullet", "groups", "track"]


def test_a_former_recording_is_read_and_measured(recorded: Path) -> None:
    recording = open_recording(recorded)
    assert recording.sessions
    for number in recording.sessions:
        session = recording.session(number)
        assert len(session.trials) >= 1
        assert (session.trials["outcome"] != "").all()
        time = session.streams["state"].time
        assert len(time) > 100
        assert (np.diff(time) > 0.0).all()
        measured = measure_session(session)
        assert len(measured) == len(session.trials)
        np.testing.assert_array_equal(measured["trial"], session.trials["trial"])


@pytest.mark.parametrize("form", ["tables", "matlab", "bids", "zip", "psychds"])
def test_a_former_recording_is_exported(recorded: Path, tmp_path: Path, form: str) -> None:
    words = {"zip": ["--set", "license=CC0-1.0"], "psychds": ["--set", "description=former"]}
    data, out = str(recorded.parents[1]), str(tmp_path / "out")
    more = words.get(form, [])
    to = ["export", data, "--to", form, "--out", out, "--include", "simulated", *more]
    assert main(to) == 0
    assert any(path.is_file() for path in Path(out).rglob("*"))


def test_a_former_recording_is_in_a_report(recorded: Path, tmp_path: Path) -> None:
    data, out = str(recorded.parents[1]), tmp_path / "report"
    assert main(["report", data, "--include", "simulated", "--out", str(out)]) == 0
    assert recorded.stem in (out / "report.html").read_text(encoding="utf-8")


def test_a_former_recording_is_replayed_or_the_tick_is_named_at_which_it_differs(
    recorded: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    status = main(["replay", str(recorded)])
    said = capsys.readouterr()
    assert status == 0 or "tick" in said.out + said.err
