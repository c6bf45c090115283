"""SIGKILL of every process of a run, alone and in pairs: a resumed session is as it was planned."""

import itertools
import json
import random
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import psutil
import pytest
from faults.sessions import a_witness, labcrane, unique, wait_for
from simple_crane import FORM

from labcrane import open_recording
from labcrane.design.plan import plan_session
from labcrane.protocol.study import load
from labcrane.registry.registry import discover

STUDY = (
    """\
labcrane: 1
study: {study}
title: A study whose processes are killed
rate_hz: 240
"""
    + FORM
    + """\
tasks:
  aiming: {{use: aiming, distances: [2, 3], movements: 2, limit_s: 0.3}}
views: {{lamp: {{use: lamp}}}}
sessions:
  - name: only
    steps:
      - practice: {{task: aiming, pairs: 1}}
      - block: {{task: aiming}}
      - break: {{seconds: 0.3}}
      - block: {{task: aiming, pairs: 1}}
"""
)

PLUGIN = """
import numpy as np
from labcrane import Feedback, Settings, Signal, hookimpl, offer


class Lamp(Feedback):
    signals = (Signal("lit", "1"),)

    def present(self, frame):
        return np.ones(1)


@hookimpl
def labcrane_feedback():
    return [offer("lamp", Settings, lambda settings, machine: Lamp())]
"""

VICTIMS = ("launcher", "session", "recorder", "feedback", "page")
PAIRS = tuple(itertools.combinations(VICTIMS, 2))
DOZEN = (
    *((victim,) for victim in VICTIMS),
    ("launcher",),
    ("session",),
    ("launcher", "session"),
    ("session", "recorder"),
    ("launcher", "recorder"),
    ("session", "page"),
    ("recorder", "feedback"),
)
RESULTS = {"success", "failure", "timeout", "skipped"}


@dataclass
class Lab:
    """A study and its plan, to be run and killed many times."""

    protocol: Path
    planned: list[int]
    seen: Path

    def start(self, command: str, data: Path, *more: str):
        arguments = ("--participant", "P001", "--simulate", "--feedback", "--data", data)
        return labcrane(command, self.protocol, *arguments, *more)


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Lab]:
    folder = tmp_path_factory.mktemp("kills")
    study = unique("kills")
    (folder / "plugins").mkdir()
    (folder / "plugins" / "lamp.py").write_text(PLUGIN)
    protocol = folder / "study.yaml"
    protocol.write_text(STUDY.format(study=study))
    plan = plan_session(load(protocol, discover(study=protocol)), "P001", 1)
    trials = [trial for block in plan.blocks for trial in block.trials]
    counted = [trial.number for trial in trials if trial.planned.counted]
    with a_witness(study, folder / "seen.jsonl"):
        yield Lab(protocol, counted, folder / "seen.jsonl")


def find(launcher: psutil.Process, folder: Path) -> dict[str, psutil.Process]:
    """Return the processes of a run by what they do."""
    found = {"launcher": launcher}
    for child in launcher.children(recursive=True):
        try:
            said, files = " ".join(child.cmdline()), [file.path for file in child.open_files()]
        except psutil.Error:
            continue
        mine = [path for path in files if path.startswith(str(folder))]
        if any("_streams" in path for path in mine):
            found["recorder"] = child
        elif any("_run" in path and path.endswith(".xdf") for path in mine):
            found["session"] = child
        elif "labcrane.feedback" in said:
            found["feedback"] = child
        elif "labcrane.web" in said:
            found["page"] = child
    return found


def kill(lab: Lab, data: Path, victims: tuple[str, ...], chance: random.Random) -> set[str]:
    """Run a session and kill ``victims`` in its middle; return which of them there were."""
    page = "--page" if "page" in victims else "--no-page"
    run = lab.start("run", data, page)
    journal = data / "P001-SIMULATED" / "ses-01_run.xdf"
    wait_for(lambda: run.poll() is not None or journal.exists())
    assert run.poll() is None, run.communicate()
    launcher = psutil.Process(run.pid)
    everybody = [launcher, *launcher.children(recursive=True)]
    time.sleep(chance.uniform(0.0, 3.0))
    found = find(launcher, data) if run.poll() is None else {}
    killed = [name for name in victims if name in found]
    for name in killed:
        found[name].kill()
    run.communicate(timeout=120)
    psutil.wait_procs(everybody, timeout=60)
    return set(killed)


def go_on(lab: Lab, data: Path) -> list[str]:
    """Resume until there is nothing to go on with; return what was said."""
    said = []
    for _ in range(4):
        resumed = lab.start("resume", data, "--no-page")
        said.append(" ".join(resumed.communicate(timeout=120)[0].split()))
        if "so there is nothing to go on with" in said[-1]:
            return said
        assert resumed.returncode == 0, said
    raise AssertionError(f"it comes to no end: {said}")


def check(lab: Lab, data: Path, began: float, ended: float) -> int:
    """Make sure that all is there, and once; return how many samples a witness has seen."""
    session = open_recording(data / "P001-SIMULATED" / "P001-SIMULATED.h5").session(1)
    trials = session.trials
    results = trials[trials["outcome"].isin(RESULTS)]
    assert results["trial"].astype(int).tolist() == lab.planned
    assert session.events["data"].iloc[-1] == {"reason": "complete", "owed": ""}
    ticks = session.streams["loop"].data["tick"].to_numpy()
    for tick in np.split(ticks, np.flatnonzero(ticks == 0.0)[1:]):  # each part begins anew
        np.testing.assert_array_equal(tick, np.arange(len(tick)))
    state = session.streams["state"]
    rows = dict(zip(state.time.tolist(), state.data.to_numpy().tolist(), strict=True))
    lines = lab.seen.read_text().splitlines()
    heard = [json.loads(line) for line in lines if line.startswith("[") and line.endswith("]")]
    heard = [(stamp, sample) for stamp, sample in heard if began <= stamp <= ended]
    for stamp, sample in heard:
        assert rows[stamp] == sample, "whatever anybody has seen was written before"
    return len(heard)


def kill_and_go_on(lab: Lab, data: Path, victims: tuple[str, ...], seed: int) -> set[str]:
    began = time.perf_counter()
    killed = kill(lab, data, victims, random.Random(seed))
    said = go_on(lab, data)
    if killed & {"session", "launcher"} and len(said) > 1:
        assert "repeated, as new attempts (redo_trial): trials" in said[0]
    check(lab, data, began, time.perf_counter())
    return killed


@pytest.mark.long
@pytest.mark.timeout(300)
@pytest.mark.parametrize(("number", "victims"), list(enumerate(DOZEN)))
def test_a_session_whose_processes_were_killed_comes_to_its_planned_end(
    lab: Lab, tmp_path: Path, number: int, victims: tuple[str, ...]
) -> None:
    assert kill_and_go_on(lab, tmp_path, victims, number) == set(victims)


@pytest.mark.soak
@pytest.mark.timeout(300)
@pytest.mark.parametrize("number", range(60))
@pytest.mark.parametrize("victim", VICTIMS)
def test_sixty_kills_of_each_process(lab: Lab, tmp_path: Path, number: int, victim: str) -> None:
    kill_and_go_on(lab, tmp_path, (victim,), 1000 + number)


@pytest.mark.soak
@pytest.mark.timeout(300)
@pytest.mark.parametrize("number", range(3))
@pytest.mark.parametrize("pair", PAIRS, ids="-".join)
def test_thirty_kills_of_two_processes(
    lab: Lab, tmp_path: Path, number: int, pair: tuple[str, str]
) -> None:
    kill_and_go_on(lab, tmp_path, pair, 2000 + number)
