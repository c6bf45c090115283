"""A disk that fills up, or vanishes, while a session is recorded; and one that is read-only."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from recording.test_full_disk import in_namespace, needs_mounts
from rehearsal import SHORT, ScriptedConsole, a_study

from labcrane import RecordingError
from labcrane.limits import LIMITS
from labcrane.recording import frame_log
from labcrane.session.session import record
from labcrane.testing import Command, Order, Visit

SESSION = """
import sys
import tempfile
from pathlib import Path

import numpy as np
from rehearsal import SHORT, a_study

from labcrane import open_recording
from labcrane.session import session
from labcrane.session.commands import Command, Order
from labcrane.session.session import Visit, run

folder = Path(sys.argv[1])
ballast = folder / "ballast"
session.RESERVE_S = 2.0  # so that a small disk will do


class FillsTheDisk:
    def __init__(self):
        self.tick, self.told = -1, []

    def commands(self):
        self.tick += 1
        if self.tick == FILL:
            with ballast.open("wb", buffering=0) as file:
                try:
                    while file.write(bytes(4096)):
                        pass
                except OSError:
                    pass
        if self.tick == FREE:
            ballast.unlink()
        return []

    def report(self, event):
        self.told.append(event)


study = a_study(Path(tempfile.mkdtemp()), SHORT)
visit = Visit(study, "P001", 1, folder / "data", simulated=True)
console = FillsTheDisk()
path = run(visit, console)
names = [event.name for event in console.told]
assert names.count("disk.lost") == 1, names
assert names.count("disk.back") == 1, names
recorded = open_recording(path).session(1)
ticks = recorded.streams["loop"].data["tick"].to_numpy()
np.testing.assert_array_equal(ticks, np.arange(len(ticks)))  # no frame is missing
assert recorded.events["name"].tolist()[1:] == names
paused = recorded.streams["loop"].data["paused"].to_numpy()
# The alarm comes with the frame that the disk refuses, or before; at most a second late.
assert paused[FREE - 100 : FREE].all()
assert not paused[: FILL].any()
command = recorded.streams["command"].data.iloc[:, :4].to_numpy()
assert not command[paused == 1].any()
assert all(outcome == "success" for outcome in recorded.trials["outcome"])
print("whole")
"""


VANISHES = (
    SESSION[: SESSION.index("class FillsTheDisk")]
    + """
import subprocess
disk = Path(tempfile.mkdtemp())


def mount(*words):
    subprocess.run([*map(str, words)], check=True)


mount("mount", "-t", "tmpfs", "none", disk)
mount("mount", "--bind", disk, folder)


class TakesTheDiskAway:
    def __init__(self):
        self.tick, self.told = -1, []

    def commands(self):
        self.tick += 1
        if self.tick == AWAY:
            mount("umount", "--lazy", folder)
        if self.tick == BACK:
            mount("mount", "--bind", disk, folder)
        return []

    def report(self, event):
        self.told.append(event)


study = a_study(Path(tempfile.mkdtemp()), SHORT)
console = TakesTheDiskAway()
path = run(Visit(study, "P001", 1, folder / "data", simulated=True), console)
names = [event.name for event in console.told]
assert names.count("disk.lost") == 1, names
assert names.count("disk.back") == 1, names
recorded = open_recording(path).session(1)
loop = recorded.streams["loop"].data
ticks = loop["tick"].to_numpy()
np.testing.assert_array_equal(ticks, np.arange(len(ticks)))  # no frame is missing
paused = np.flatnonzero(loop["paused"].to_numpy())
assert AWAY <= paused[0] <= AWAY + 2, paused[0]  # by the first write that finds it gone
assert (np.diff(paused) == 1).all() and paused[-1] >= BACK - 1
assert all(outcome == "success" for outcome in recorded.trials["outcome"])
print("whole")
"""
)


@pytest.mark.long
@needs_mounts
def test_a_disk_that_vanishes_is_noticed_by_the_next_write_and_loses_no_frame(
    tmp_path: Path,
) -> None:
    script = VANISHES.replace("AWAY", "400").replace("BACK", "900")
    done = in_namespace("size=48m", script, tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "whole" in done.stdout


@pytest.mark.long
@needs_mounts
def test_a_session_on_a_full_disk_is_held_and_loses_no_frame(tmp_path: Path) -> None:
    script = SESSION.replace("FILL", "400").replace("FREE", "1200")
    done = in_namespace("size=48m", script, tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "whole" in done.stdout


READ_ONLY = """
import subprocess, sys, tempfile
from pathlib import Path
folder = Path(sys.argv[1])
subprocess.run(["mount", "-o", "remount,ro", str(folder)], check=True)
from rehearsal import SHORT, ScriptedConsole, a_study
from labcrane import RecordingError
from labcrane.session.session import Visit, run
study = a_study(Path(tempfile.mkdtemp()), SHORT)
try:
    run(Visit(study, "P001", 1, folder / "data", simulated=True, fast=True), ScriptedConsole())
except RecordingError as error:
    print(error)
"""


@needs_mounts
def test_a_read_only_data_folder_is_told_before_anything_runs(tmp_path: Path) -> None:
    done = in_namespace("size=1m", READ_ONLY, tmp_path)
    assert done.returncode == 0, done.stderr
    assert "cannot be written: Read-only file system; give another with --data" in done.stdout


SMALL = READ_ONLY.replace(
    'subprocess.run(["mount", "-o", "remount,ro", str(folder)], check=True)', ""
)


@needs_mounts
def test_a_session_that_will_not_fit_is_refused_with_numbers(tmp_path: Path) -> None:
    done = in_namespace("size=2m", SMALL, tmp_path)
    assert done.returncode == 0, done.stderr
    assert "the session needs up to" in done.stdout
    assert "and only 2 MB are free" in done.stdout


@pytest.mark.slow
def test_no_more_frames_wait_for_a_disk_than_the_table_of_limits_allows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    few = replace(LIMITS["frames waiting for a disk"], most=200_000)
    monkeypatch.setattr(frame_log, "LIMITS", {**LIMITS, "frames waiting for a disk": few})
    visit = Visit(a_study(tmp_path, SHORT), "P001", 1, tmp_path / "data", simulated=True)

    class RemovesTheFolder(ScriptedConsole):
        def commands(self) -> list[Command]:
            if self._tick == 100:
                shutil.rmtree(visit.folder.path)
            return super().commands()

    console = RemovesTheFolder({2000: [Command(Order.END)]})
    with pytest.raises(RecordingError, match="the file was removed") as caught:
        record(visit, console)
    [said] = caught.value.__notes__
    assert "frames and events wait for the disk, and no more can: cannot write" in said
    assert "the session ends: repair the disk, then run labcrane resume" in said
    assert "order.end" not in [event.name for event in console.told], "long before the order"


@pytest.mark.slow
def test_a_folder_that_vanishes_holds_the_session(tmp_path: Path) -> None:
    visit = Visit(a_study(tmp_path, SHORT), "P001", 1, tmp_path / "data", simulated=True)
    told = []

    class RemovesTheFolder:
        tick = -1

        def commands(self) -> list[Command]:
            self.tick += 1
            if self.tick == 100:
                shutil.rmtree(visit.folder.path)
            return [Command(Order.END)] if self.tick == 700 else []

        def report(self, event) -> None:
            told.append(event)

    with pytest.raises(RecordingError, match="the file was removed") as caught:
        record(visit, RemovesTheFolder())
    assert "frames and events could not be written" in caught.value.__notes__[0]
    (lost,) = (event for event in told if event.name == "disk.lost")
    assert "the file was removed" in lost.data["why"]
