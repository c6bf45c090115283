"""Checks of what ends with a run of tests."""

import os
import subprocess
import sys
from pathlib import Path

import leavings
import psutil
import pytest

RUN = """
import subprocess, sys, time
sys.path.insert(0, {folder!r})
import leavings
leavings.watch()
left = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
print(left.pid, flush=True)
time.sleep(600)
"""


@pytest.mark.slow
def test_what_a_killed_run_started_ends_and_others_go_on() -> None:
    folder = str(Path(leavings.__file__).parent)
    program = [sys.executable, "-c", RUN.format(folder=folder)]
    with (
        subprocess.Popen(program, stdout=subprocess.PIPE, text=True) as killed,
        subprocess.Popen(program, stdout=subprocess.PIPE, text=True) as other,
    ):
        assert killed.stdout is not None
        assert other.stdout is not None
        left = psutil.Process(int(killed.stdout.readline()))
        of_other = psutil.Process(int(other.stdout.readline()))
        killed.kill()
        killed.wait()
        left.wait(60)
        assert of_other.is_running()
        assert other.poll() is None
        other.kill()
        other.wait()
        of_other.wait(60)


@pytest.mark.skipif(sys.platform == "win32", reason="watched on Unix alone")
def test_this_run_is_watched() -> None:
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as started:
        left = leavings.left(os.environ[leavings.RUN])
        started.communicate(b"\n")
    assert started.pid in {process.pid for process in left}
