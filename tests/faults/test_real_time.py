"""A session in real time: what it asks of the system, what it is granted, and what is recorded."""

import os
import sys
from pathlib import Path

import psutil
import pytest
from faults.sessions import STUDY, labcrane, session_process, unique, wait_for
from needs import needs
from programs import ran

from labcrane import open_recording
from labcrane.processes.real_time import PRIORITY
from labcrane.testing import main

STAT_PRIORITY, STAT_POLICY = 39, 40
"""Fields of /proc/PID/stat, counted from 0, by proc(5): rt_priority and policy."""


def scheduling(thread: int) -> tuple[int, int]:
    """Return policy and real-time priority of a thread."""
    fields = Path(f"/proc/{thread}/stat").read_text().rpartition(")")[2].split()
    return int(fields[STAT_POLICY - 2]), int(fields[STAT_PRIORITY - 2])


def run(folder: Path, *words: str):
    protocol = folder / "study.yaml"
    protocol.write_text(STUDY.format(study=unique("priority")), encoding="utf-8")
    asked = ["run", protocol, "--participant", "P001", "--session", 2, "--simulate"]
    return labcrane(*asked, "--data", folder / "data", *words)


@pytest.mark.long
@needs("real-time priorities", "Linux")
def test_the_loop_alone_is_real_time_on_a_core_that_labcranes_others_leave(tmp_path: Path) -> None:
    cores = sorted(os.sched_getaffinity(0))
    launcher = run(tmp_path, "--real-time")
    try:
        wait_for(lambda: session_process(launcher))
        session = session_process(launcher)
        assert session is not None
        wait_for(lambda: scheduling(session.pid) == (os.SCHED_FIFO, PRIORITY))
        wait_for(lambda: len(session.threads()) > 1)
        others = {thread.id for thread in session.threads()} - {session.pid}
        assert {scheduling(thread)[0] for thread in others} == {os.SCHED_OTHER}
        if len(cores) > 1:
            wait_for(lambda: session.cpu_affinity() == cores[-1:])
            for process in (psutil.Process(launcher.pid), *_besides(launcher, session)):
                assert process.cpu_affinity() == cores[:-1], process
        said, _ = launcher.communicate()
    finally:
        launcher.kill()
        launcher.wait()
    assert launcher.returncode == 0, said
    recording = open_recording(tmp_path / "data" / "P001-SIMULATED" / "P001-SIMULATED.h5")
    found = recording.session(2).context["real_time"]
    assert found["priority"] == f"SCHED_FIFO {PRIORITY}"
    assert found["core"].startswith(f"core {cores[-1]}," if len(cores) > 1 else "any")
    for spell in ("before", "with"):
        lateness = found["lateness_ms"][spell]
        assert 0 <= lateness["p50"] <= lateness["p99"] <= lateness["most"]


def _besides(launcher, session: psutil.Process) -> list[psutil.Process]:
    children = psutil.Process(launcher.pid).children(recursive=True)
    return [each for each in children if each.pid != session.pid]


@pytest.mark.slow
@needs("Linux", "networks")
def test_who_may_have_no_real_time_priority_is_told_how_before_anything_is_recorded(
    tmp_path: Path,
) -> None:
    protocol = tmp_path / "study.yaml"
    protocol.write_text(STUDY.format(study=unique("priority")), encoding="utf-8")
    asked = ["run", str(protocol), "--participant", "P001", "--session", "2", "--simulate"]
    nobody = ["unshare", "-r", "prlimit", "--rtprio=0"]
    done = ran([*nobody, sys.executable, "-m", "labcrane", *asked, "--real-time"])
    assert done.returncode == 1
    assert (
        "--real-time: this user may have no real-time priorities; write '@labcrane - rtprio "
        f"{PRIORITY}' and '@labcrane - memlock unlimited' into /etc/security/limits.d/labcrane.conf"
    ) in done.stderr
    assert not list(tmp_path.rglob("*.xdf"))


def test_a_session_without_a_clock_has_no_real_time(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["run", "study.yaml", "--participant", "P001", "--simulate", "--fast", "--real-time"]
    assert main(words) == 2
    assert "--fast and --real-time cannot be combined; drop one" in (
        " ".join(capsys.readouterr().err.split())
    )
