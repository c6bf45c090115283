"""A file that pyxdf cannot read is corrected all the same: it is compared with nothing."""

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from labcrane.clocks.xdf import resync_xdf
from labcrane.recording.xdf.header import Channel, StreamHeader
from labcrane.recording.xdf.writer import XdfWriter

pyxdf = pytest.importorskip("pyxdf")


ERRORS = [struct.error("short"), KeyError("info"), IndexError(), ValueError(), RuntimeError()]


@pytest.mark.parametrize("error", ERRORS, ids=repr)
def test_whatever_pyxdf_raises_of_a_file_ends_no_correction(
    error: Exception, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.xdf"
    header = StreamHeader("EEG", "EEG", (Channel("a"),), rate_hz=100.0, source_id="x")
    writer = XdfWriter(path)
    number = writer.add_stream(header)
    times = 1.0 + np.arange(500) / 100.0
    writer.write_samples(number, times, np.zeros((500, 1)))
    writer.close()

    def load(*args: Any, **more: Any) -> Any:
        raise error

    monkeypatch.setattr(pyxdf, "load_xdf", load)
    done = resync_xdf(path)
    assert done.against_pyxdf == {}
    assert done.unread_by_pyxdf == f"{type(error).__name__}: {error}"
    assert done.path.is_file()
