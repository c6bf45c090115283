"""A process that cannot be ended, as one whose driver waits for a device: it is left, by name."""

import subprocess
from pathlib import Path

import pytest

from labcrane.capture import processes
from labcrane.processes import handle
from labcrane.session.part import PartConfig

WAITS = """
import signal
import time

for each in (signal.SIGINT, signal.SIGTERM):
    signal.signal(each, signal.SIG_IGN)
while True:
    time.sleep(60.0)
"""


def test_a_recording_that_cannot_be_ended_is_left_and_named(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(handle, "KILLED_S", 0.05)
    monkeypatch.setattr(processes, "START_S", 0.0)  # it hangs from the beginning
    monkeypatch.setattr(processes, "STOP_S", 0.05)
    (tmp_path / "waits_for_a_device.py").write_text(WAITS)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    end = subprocess.Popen.kill
    config = PartConfig(
        protocol=tmp_path,
        recorded=False,
        name="face",
        source="x",
        journal=tmp_path / "ses-01_run.xdf",
    )
    with monkeypatch.context() as unkillable:
        unkillable.setattr(processes, "MODULE", "waits_for_a_device")
        unkillable.setattr(subprocess.Popen, "kill", lambda self: None)
        left = processes._Handle(config, required=True)
        first = left.pid
        said = [line for _ in range(20) for line in left.watch()]
        assert said == [left.stuck]
        assert f"its process {first} cannot be ended" in left.stuck
        assert (left.pid, left.stop()) == (first, None)
    end(left._present.process)
    left._present.process.wait()
    (line,) = left.watch()
    assert line.startswith("failed: its process ended with exit code -9; it is started again")
    left.stop()
