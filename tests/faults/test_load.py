"""A whole laboratory at once: nothing is lost, memory stays, and the loop does not notice."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import psutil
import pytest
from faults.sessions import STUDY, labcrane, recorder_process, unique, wait_for

from labcrane import open_recording

REST = """\
sessions:
  - name: off
    steps:
      - break: {{seconds: {seconds}}}
"""
NEEDS = """\
streams:
  eeg: {{source_id: {word}-EEG, rate_hz: 1000, channels: 64, counter: Counter}}
  gaze: {{source_id: {word}-Gaze, rate_hz: 200, counter: Counter}}
  markers: {{source_id: {word}-Markers}}
"""


RATE_HZ = 240


def lateness(path: Path) -> np.ndarray:
    loop = open_recording(path).session(1).streams["loop"].data
    return (loop["woke"] - loop["due"]).to_numpy()


def usual(late: np.ndarray) -> float:
    """Return the 99th percentile of a second's lateness, of the median second.

    A second in which the computer itself stood still says nothing of recording.
    """
    whole = late[: len(late) // RATE_HZ * RATE_HZ].reshape(-1, RATE_HZ)
    return float(np.median(np.quantile(whole, 0.99, axis=1)))


def a_study(path: Path, seconds: float, needs: str = "") -> Path:
    head = STUDY.format(study=unique("load")).partition("sessions:")[0]
    path.write_text(head + REST.format(seconds=seconds) + needs)
    return path


@pytest.mark.parametrize(
    "seconds",
    [
        pytest.param(60, marks=pytest.mark.long),
        pytest.param(600, marks=[pytest.mark.soak, pytest.mark.timeout(900)]),
    ],
)
def test_a_laboratory_is_recorded_whole_and_the_loop_does_not_notice(
    tmp_path: Path, seconds: int
) -> None:
    word = unique("lab")
    without = a_study(tmp_path / "without.yaml", seconds=20)
    beside = a_study(tmp_path / "beside.yaml", seconds + 6, NEEDS.format(word=word))
    program = [sys.executable, str(Path(__file__).with_name("laboratory.py")), word]
    devices = subprocess.Popen(
        [*program, str(seconds + 30)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    try:
        assert devices.stdout.readline() == "ready\n"
        launcher = labcrane(
            "run", beside, "--participant", "P002", "--simulate", "--data", tmp_path / "data"
        )
        journal = tmp_path / "data" / "P002-SIMULATED" / "ses-01_run.xdf"
        wait_for(journal.exists)
        folder = journal.parent
        wait_for(lambda: recorder_process(launcher) is not None)
        recorder = recorder_process(launcher)
        # Connected when the headers of all three are written.
        wait_for(lambda: _headers(folder / "ses-01_streams.xdf") == 3)
        devices.stdin.write("go\n")
        devices.stdin.flush()
        memory = _memory(recorder, launcher)
        said, _ = launcher.communicate(timeout=120)
        assert launcher.returncode == 0, said
        off = labcrane(
            "run", without, "--participant", "P001", "--simulate", "--data", tmp_path / "data"
        )
        said, _ = off.communicate(timeout=120)
        assert off.returncode == 0, said
    finally:
        devices.kill()
        devices.communicate()
    session = open_recording(folder / "P002-SIMULATED.h5").session(1)
    for name, rate in (("EEG", 1000), ("Gaze", 200)):
        counter = session.streams[name].data["Counter"].to_numpy()
        assert len(counter) >= 0.95 * seconds * rate
        np.testing.assert_array_equal(counter, np.arange(len(counter)))
    markers = session.streams["Markers"].data.iloc[:, 0].tolist()
    assert markers == [f"marker {number}" for number in range(len(markers))]
    ticks = session.streams["loop"].data["tick"].to_numpy()
    np.testing.assert_array_equal(ticks, np.arange(len(ticks)))
    # Memory is read each second; the first ten are start-up.
    assert np.ptp(memory[10:]) < 30e6, f"the recorder's memory went through {np.ptp(memory):.0f} B"
    on = lateness(folder / "P002-SIMULATED.h5")
    alone = lateness(tmp_path / "data" / "P001-SIMULATED" / "P001-SIMULATED.h5")
    assert usual(on) <= usual(alone) + 0.25 / RATE_HZ


def _headers(path: Path) -> int:
    text = path.read_bytes()
    return sum(text.count(f"<name>{name}</name>".encode()) for name in ("EEG", "Gaze", "Markers"))


def _memory(recorder: psutil.Process, launcher: "subprocess.Popen[str]") -> np.ndarray:
    """Return the recorder's memory in bytes, once a second until the session has ended."""
    used = []
    while launcher.poll() is None:
        try:
            used.append(recorder.memory_info().rss)
            launcher.wait(1.0)
        except subprocess.TimeoutExpired:
            continue
        except psutil.NoSuchProcess:
            break
    return np.array(used[:-2])
