"""Streams whose clock was never probed, and what becomes of them."""

import json
import shutil
from pathlib import Path

import h5py
import pytest

from labcrane.testing import main


@pytest.fixture
def unprobed(data: Path, tmp_path: Path) -> Path:
    copied = tmp_path / "data"
    shutil.copytree(data, copied)
    shutil.rmtree(copied / "P007")  # a wreck
    with h5py.File(copied / "P001" / "P001.h5", "a") as file:
        file["ses-01/streams/eyes/time"].attrs["unprobed"] = 12.0
    return copied


@pytest.mark.slow
def test_an_export_refuses_streams_never_probed_unless_told_and_says_so(
    unprobed: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    export = ["export", str(unprobed), "--to", "tables"]
    assert main([*export, "--out", str(tmp_path / "no")]) == 1
    said = " ".join(capsys.readouterr().err.split())
    assert "timestamp accuracy of eyes of P001, session 1 (12 of" in said
    assert "--accept-unprobed" in said
    assert not (tmp_path / "no").exists()
    assert main([*export, "--out", str(tmp_path / "yes"), "--accept-unprobed"]) == 0
    manifest = json.loads(
        (tmp_path / "yes" / ".labcrane" / "labcrane_export.json").read_text(encoding="utf-8")
    )
    (noted,) = manifest["unprobed"]
    assert noted.startswith("eyes of P001, session 1 (12 of")


@pytest.mark.slow
def test_a_report_refuses_streams_never_probed_unless_told_and_says_so(
    unprobed: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    report = ["report", str(unprobed), "--out", str(tmp_path / "report")]
    assert main(report) == 1
    assert "--accept-unprobed" in capsys.readouterr().err
    assert not (tmp_path / "report").exists()
    assert main([*report, "--accept-unprobed"]) == 0
    said = " ".join((tmp_path / "report" / "report.html").read_text(encoding="utf-8").split())
    assert "timestamp accuracy is unknown: eyes of P001, session 1 (12 of" in said
