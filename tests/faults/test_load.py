"""A whole laboratory at once: nothing is lost, and memory stays."""

import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import psutil
import pytest
from faults.sessions import STUDY, finished, labcrane, recorder_process, unique, wait_for
from streams.emulation import Lab

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


BYTES_PER_S = 4 * (64 * 1000 + 8 * 200)
"""What laboratory.py sends of numbers, without their stamps."""

START_UP_S = 10
"""Until then a recorder's memory still grows: buffers are filled, libraries loaded."""

MOST_KEPT = 0.25
"""Share of what was received that may be in memory at the end; a recorder that keeps every sample
has all of it, and one that writes and forgets a fiftieth."""


def kept(memory: np.ndarray) -> float:
    """Return the growth of memory as a share of what was received; one reading a second."""
    settled = memory[START_UP_S:]
    return float((settled[-1] - settled[0]) / (BYTES_PER_S * (len(settled) - 1)))


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
def test_a_laboratory_is_recorded_whole_and_nothing_of_it_stays_in_memory(
    tmp_path: Path, seconds: int
) -> None:
    word = unique("lab")
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
        finished(launcher)
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
    assert kept(memory) < MOST_KEPT


def _headers(path: Path) -> int:
    text = path.read_bytes()
    return sum(text.count(f"<name>{name}</name>".encode()) for name in ("EEG", "Gaze", "Markers"))


def _memory(recorder: psutil.Process, launcher: "subprocess.Popen[str]") -> np.ndarray:
    """Return the recorder's own memory in bytes, once a second until the session has ended."""
    used = []
    while launcher.poll() is None:
        try:
            used.append(recorder.memory_full_info().uss)
            launcher.wait(1.0)
        except subprocess.TimeoutExpired:
            continue
        except psutil.NoSuchProcess:
            break
    return np.array(used[:-2])


LEAK = """
import sys

if "labcrane.streams.recorder.process" in sys.orig_argv:
    import numpy as np
    import pylsl

    KEPT, pull = [], pylsl.StreamInlet.pull_chunk

    def pull_and_keep(self, *arguments, **options):
        samples, stamps = pull(self, *arguments, **options)
        KEPT.append(np.array(samples))
        return samples, stamps

    pylsl.StreamInlet.pull_chunk = pull_and_keep
"""


@pytest.mark.long
@pytest.mark.parametrize("fault", ["", LEAK], ids=["sound", "leaking"])
def test_a_recorder_that_keeps_every_sample_is_told_from_one_that_forgets_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fault: str
) -> None:
    if fault:
        (tmp_path / "sitecustomize.py").write_text(fault)
        monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    word, seconds = unique("kept"), START_UP_S + 20
    program = [sys.executable, str(Path(__file__).with_name("laboratory.py")), word]
    devices = subprocess.Popen(
        [*program, str(seconds + 30)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    lab = Lab(tmp_path, Path("not needed"))
    try:
        assert devices.stdout.readline() == "ready\n"
        names = ("EEG", "Gaze", "Markers")
        recorder = lab.recorder(*({"label": n, "source_id": f"{word}-{n}"} for n in names))
        wait_for(lambda: lab.journal.exists() and _headers(lab.journal) == 3)
        devices.stdin.write("go\n")
        devices.stdin.flush()
        process, memory = psutil.Process(recorder.pid), []
        while len(memory) <= seconds:  # its status comes several times a second, and is read
            assert recorder.stdout.readline()
            now = time.monotonic()
            if now - (memory[-1][0] if memory else 0.0) >= 1.0:
                memory.append((now, process.memory_full_info().uss))
    finally:
        devices.kill()
        devices.communicate()
        lab.close()
    share = kept(np.array([bytes_ for _, bytes_ in memory]))
    assert (share > MOST_KEPT) == bool(fault), share
