"""Sessions of real processes that are filmed: killed, with a device that goes, and resumed."""

import stat
from pathlib import Path

import numpy as np
import psutil
import pytest
from faults.sessions import finished, labcrane, session_process, wait_for
from needs import needs
from plugins.test_film import frames_in
from recording.test_full_disk import in_namespace
from simple_crane import CRANE

from labcrane import open_recording

CLOCKED = "settb=1/1000000,realtime,setpts=RTCTIME"
STUDY = (
    """\
labcrane: 1
study: filmed
title: A study that is filmed
rate_hz: 240
"""
    + CRANE
    + """\
tasks:
  aiming: {use: aiming, distances: [2], movements: 4, limit_s: 3}
sessions:
  - name: only
    steps:
      - block: {task: aiming, pairs: 1}
on_fault: {session_died: redo_trial}
recordings:
  face:
    use: camera
    format: lavfi
    device: "testsrc2=size=160x120:rate=30,CLOCKED"
    lag_s: 0.0
    lag_error_s: 0.001
    consent: we film your face
  room:
    use: microphone
    format: lavfi
    device: "sine=sample_rate=48000,arealtime"
    consent: we record your voice
"""
).replace("CLOCKED", CLOCKED)
WHO = ("--participant", "P001", "--simulate", "--data")


def filming(launcher: object, name: str) -> psutil.Process | None:
    """Return the process that writes the files of a recording."""
    for child in psutil.Process(launcher.pid).children():
        try:
            if any(f"ses-01_{name}." in file.path for file in child.open_files()):
                return child
        except (psutil.NoSuchProcess, psutil.AccessDenied):
            continue
    return None


def size(path: Path) -> int:
    return path.stat().st_size if path.exists() else 0


def check_files(folder: Path, name: str, *, files: int) -> None:
    """Check that each listed frame is in its file, and that hardly one is not listed."""
    session = open_recording(folder / f"{folder.name}.h5").session(1)
    listed = session.streams[f"labcrane.capture.{name}"]
    data = listed.data
    assert set(data["file"]) == set(range(1, files + 1))
    for number in range(1, files + 1):
        path = folder / f"ses-01_{name}{f'.{number}' if number > 1 else ''}.mkv"
        assert stat.S_IMODE(path.stat().st_mode) == 0o600
        own = data["file"] == number
        found = frames_in(path)
        np.testing.assert_allclose(found[: own.sum()], data["pts"][own], atol=1e-9)
        # Within a file, the times are those of the frames: not of when they were listed.
        times, places = listed.time[own], data["pts"][own].to_numpy()
        open_s = data["arrival"].max() + 0.01
        assert np.abs((times - times[0]) - (places - places[0])).max() < open_s
    loop = session.streams["loop"].time
    assert listed.time[0] < loop[0] + 0.5


@pytest.mark.slow
def test_recordings_that_are_killed_go_on_in_the_next_file(tmp_path: Path) -> None:
    protocol, data = tmp_path / "study.yaml", tmp_path / "data"
    protocol.write_text(STUDY)
    launcher = labcrane("run", protocol, *WHO, data)
    folder = data / "P001-SIMULATED"
    for name, enough in (("face", 90_000), ("room", 290_000)):  # the first second is listed
        wait_for(lambda path=folder / f"ses-01_{name}.mkv", n=enough: size(path) > n)
        victim = filming(launcher, name)
        assert victim is not None
        victim.kill()
    said = finished(launcher)
    assert "recording face: failed: its process ended with exit code -9" in said
    assert "recording face: is written to ses-01_face.2.mkv" in said
    for name in ("face", "room"):
        check_files(folder, name, files=2)
    session = open_recording(folder / f"{folder.name}.h5").session(1)
    error = session.streams["labcrane.capture.face"].time_error
    assert np.nanmax(error) < 0.01


@pytest.mark.slow
def test_a_session_that_is_killed_and_resumed_is_filmed_in_both_parts(tmp_path: Path) -> None:
    protocol, data = tmp_path / "study.yaml", tmp_path / "data"
    protocol.write_text(STUDY)
    launcher = labcrane("run", protocol, *WHO, data)
    folder = data / "P001-SIMULATED"
    wait_for(lambda: size(folder / "ses-01_face.mkv") > 60_000)
    wait_for(lambda: session_process(launcher) is not None)
    wait_for(lambda: size(folder / "ses-01_run.xdf") > 100_000)
    session_process(launcher).kill()
    launcher.communicate(timeout=240)
    finished(labcrane("resume", protocol, *WHO, data))
    for name in ("face", "room"):
        check_files(folder, name, files=2)


FILLED = """
import sys
import time
from pathlib import Path
from faults.sessions import finished, labcrane, wait_for
from faults.test_filmed_session import STUDY, WHO, check_files, size

disk = Path(sys.argv[1])
protocol, ballast, folder = disk / "study.yaml", disk / "ballast", disk / "P001-SIMULATED"
protocol.write_text(STUDY)
launcher = labcrane("run", protocol, *WHO, disk)
wait_for(lambda: size(folder / "ses-01_run.xdf") > 300_000)
with ballast.open("wb", buffering=0) as file:
    try:
        while file.write(bytes(4096)):
            pass
    except OSError:
        pass
time.sleep(4.0)  # the disk is full for so long, whatever else goes on
ballast.unlink()
said = finished(launcher)
assert "MB are free at " in said, said
assert "and a recording leaves 200 MB for the session itself" in said, said
assert "recording face: is written to ses-01_face.2.mkv" in said, said
check_files(folder, "face", files=2)
print("recorded again")
"""


@needs("mounts")
@pytest.mark.slow
def test_a_full_disk_ends_a_file_and_the_next_begins_when_there_is_room(tmp_path: Path) -> None:
    done = in_namespace("size=400m", FILLED, tmp_path)
    assert done.stdout == "recorded again\n", done.stdout + done.stderr
