"""A file that pyxdf cannot read is corrected all the same: it is compared with nothing."""

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from labcrane.clocks.xdf import resync_xdf
from labcrane.recording import Channel, StreamHeader, XdfWriter

pyxdf = pytest.importorskip("pyxdf")


ERRORS = [struct.error("short"), KeyError("info"), IndexError(), ValueError(), RuntimeError()]


def written(path: Path, source_id: str) -> Path:
    header = StreamHeader("EEG", "EEG", (Channel("a"),), rate_hz=100.0, source_id=source_id)
    writer = XdfWriter(path)
    number = writer.add_stream(header)
    writer.write_samples(number, 1.0 + np.arange(500) / 100.0, np.zeros((500, 1)))
    writer.close()
    return path


@pytest.mark.parametrize("error", ERRORS, ids=repr)
def test_whatever_pyxdf_raises_of_a_file_ends_no_correction(
    error: Exception, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = written(tmp_path / "a.xdf", "x")

    def load(*args: Any, **more: Any) -> Any:
        raise error

    monkeypatch.setattr(pyxdf, "load_xdf", load)
    done = resync_xdf(path)
    assert done.against_pyxdf == {}
    assert done.unread_by_pyxdf == f"{type(error).__name__}: {error}"
    assert done.path.is_file()


@pytest.mark.parametrize("source", [[], [None], None])
def test_a_file_whose_header_leaves_out_the_source_is_no_fault_of_pyxdf(
    source: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An index error of our own was told as one of pyxdf's."""
    info = {"name": ["EEG"], "source_id": source}
    read = [{"info": info, "time_stamps": 1.0 + np.arange(500) / 100.0}]
    monkeypatch.setattr(pyxdf, "load_xdf", lambda *args, **more: (read, {}))
    done = resync_xdf(written(tmp_path / "a.xdf", ""))
    assert done.unread_by_pyxdf == ""
