"""SIGKILL of every process of a run, alone and in pairs: a resumed session is as it was planned.

Two witnesses see every sample of the session, and two more those of a device beside it.
"""

import itertools
import json
import random
import re
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import psutil
import pytest
from faults.sessions import a_witness, labcrane, program, unique, wait_for, witnessed
from simple_crane import FORM

from labcrane import open_recording
from labcrane.recording.foreign_streams import RecordedStream, read_streams
from labcrane.recording.paths import parts
from labcrane.testing import discover, load, plan_session

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
streams:
  single: {{name: Single, source_id: {study}/Single}}
  chunked: {{name: Chunked, source_id: {study}/Chunked}}
  keys: {{name: Keys, source_id: {study}/Keys}}
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
BOTH = ("recorder", "other recorder")
PAIRS = (*itertools.combinations(VICTIMS, 2), BOTH)
DOZEN = (
    *((victim,) for victim in VICTIMS),
    ("launcher",),
    ("session",),
    ("launcher", "session"),
    ("session", "recorder"),
    ("launcher", "recorder"),
    ("session", "page"),
    ("recorder", "feedback"),
    BOTH,
)
RESULTS = {"success", "failure", "timeout", "skipped"}
RATE_HZ = 250.0
CHUNK = 16
"""Samples that the device sends at once in one of its streams."""
LABS = 6
"""Laboratories among which the many kills are shared out: sessions wait in real time, so that
``pytest -n 6`` takes far less than six times one."""
BOTH_S = 2.0
"""What the death of both recorders at once may cost, in seconds of samples.

Twice of what ``test_kill_recorder`` allows: here sessions in other processes share the cores.
"""


@dataclass
class Lab:
    """A study and its plan, to be run and killed many times.

    Attributes
    ----------
    seen, heard
        What the witnesses of the session and those of the device have written down.
    """

    protocol: Path
    planned: list[int]
    seen: tuple[Path, Path]
    heard: tuple[Path, Path]

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
    seen = folder / "seen.jsonl", folder / "also seen.jsonl"
    heard = folder / "heard.jsonl", folder / "also heard.jsonl"
    with ExitStack() as stack:
        device = program("counting_device.py", study, str(RATE_HZ), into=folder / "device")
        stack.enter_context(device)
        for path in seen:
            stack.enter_context(a_witness(study, path))
        for path in heard:
            stack.enter_context(program("counting_witness.py", study, into=path))
        yield Lab(protocol, counted, seen, heard)


def find(launcher: psutil.Process, folder: Path) -> dict[str, psutil.Process]:
    """Return the processes of a run by what they do."""
    found = {"launcher": launcher}
    for child in launcher.children(recursive=True):
        try:
            said, files = " ".join(child.cmdline()), [file.path for file in child.open_files()]
        except psutil.Error:
            continue
        mine = [Path(path).name for path in files if path.startswith(str(folder))]
        if any("_streams" in path for path in mine):
            found["other recorder" if "recorder" in found else "recorder"] = child
        elif any("_run" in path and path.endswith(".xdf") for path in mine):
            found["session"] = child
        elif "labcrane.feedback" in said:
            found["feedback"] = child
        elif "labcrane.web" in said:
            found["page"] = child
    return found


def kill(
    lab: Lab, data: Path, victims: tuple[str, ...], chance: random.Random, command: str = "run"
) -> set[str]:
    """Run a session, or go on, and kill ``victims`` in its middle; return which there were."""
    page = "--page" if "page" in victims else "--no-page"
    journal = data / "P001-SIMULATED" / "ses-01_run.xdf"
    before = len(parts(journal))
    run = lab.start(command, data, page)
    wait_for(lambda: run.poll() is not None or len(parts(journal)) > before)
    if command == "run":
        assert run.poll() is None, run.communicate()
    if run.poll() is not None:  # there was nothing to go on with
        said = run.communicate()[0]
        assert "so there is nothing to continue" in " ".join(said.split()), said
        return set()
    launcher = psutil.Process(run.pid)
    everybody = [launcher, *launcher.children(recursive=True)]
    time.sleep(chance.uniform(0.0, 3.0))
    found = find(launcher, data) if run.poll() is None else {}
    killed = [name for name in victims if name in found]
    for name in killed:
        found[name].kill()
    run.communicate(timeout=240)
    psutil.wait_procs(everybody, timeout=240)
    return set(killed)


def go_on(lab: Lab, data: Path) -> list[str]:
    """Resume until there is nothing to go on with; return what was said."""
    said = []
    for _ in range(4):
        resumed = lab.start("resume", data, "--no-page")
        said.append(" ".join(resumed.communicate(timeout=240)[0].split()))
        if "so there is nothing to continue" in said[-1]:
            return said
        assert resumed.returncode == 0, said
    raise AssertionError(f"it comes to no end: {said}")


def check(lab: Lab, data: Path, began: float, ended: float) -> list[float]:
    """Make sure that all is there, and once; return what the device's streams lost, in seconds."""
    folder = data / "P001-SIMULATED"
    session = open_recording(folder / "P001-SIMULATED.h5").session(1)
    trials = session.trials
    results = trials[trials["outcome"].isin(RESULTS)]
    assert results["trial"].astype(int).tolist() == lab.planned
    assert session.events["data"].iloc[-1] == {"reason": "complete", "owed": ""}
    ticks = session.streams["loop"].data["tick"].to_numpy()
    begins = np.flatnonzero(ticks == 0.0)
    for tick in np.split(ticks, begins[1:]):  # each part begins anew
        np.testing.assert_array_equal(tick, np.arange(len(tick)))
    state = session.streams["state"]
    rows = dict(zip(state.time.tolist(), state.data.to_numpy().tolist(), strict=True))
    for path in lab.seen:
        lines = path.read_text().splitlines()
        heard = [json.loads(line) for line in lines if line.startswith("[") and line.endswith("]")]
        heard = [(stamp, sample) for stamp, sample in heard if began <= stamp <= ended]
        assert heard, "the witness has seen nothing"
        for stamp, sample in heard:
            assert rows[stamp] == sample, "whatever anybody has seen was written before"
    runs = list(zip(state.time[begins], state.time[np.r_[begins[1:], len(ticks)] - 1], strict=True))
    streams, _ = read_streams(parts(folder / "ses-01_streams.xdf"))
    found = {stream.header.name: stream for stream in streams}
    one, other = map(witnessed, lab.heard)
    return [
        lost
        for name in ("Single", "Chunked", "Keys")
        for lost in losses(found[name], one[name] & other[name], runs)
    ]


def losses(
    stream: RecordedStream, witnessed: set[int], runs: Sequence[tuple[float, float]]
) -> Iterator[float]:
    """Yield what a stream lost, hole by hole in seconds, of what both witnesses have of it.

    ``runs`` are the times of the first and last frame of every process. A stream begins with each
    of them when its recorders have found it, and ends no earlier than the session.
    """
    rows = stream.texts or stream.data
    counts = np.array([int(float(row[0])) for row in rows])
    rate = RATE_HZ / 10 if stream.header.name == "Keys" else RATE_HZ
    assert (np.diff(counts) > 0).all(), "no sample is there twice"
    heard = np.array(sorted(witnessed))
    heard_at = stream.time_raw[0] + (heard - counts[0]) / rate
    for begin, end in runs:
        mine = counts[(stream.time_raw >= begin) & (stream.time_raw <= end)]
        if not len(mine):  # killed before its recorders had found the stream
            continue
        missing = np.setdiff1d(heard[(heard >= mine[0]) & (heard_at <= end)], mine)
        holes = np.split(missing, np.flatnonzero(np.diff(missing) > 1) + 1)
        yield from (len(hole) / rate for hole in holes if len(hole))


Figures = Callable[[str, object], None]
"""``record_property``: what the evidence shows of a test."""

LOST = "seconds of a stream lost at once"


def kill_and_go_on(
    lab: Lab, data: Path, victims: tuple[str, ...], seed: int, record_property: Figures
) -> set[str]:
    began = time.perf_counter()
    killed = kill(lab, data, victims, random.Random(seed))
    said = go_on(lab, data)
    if killed & {"session", "launcher"} and len(said) > 1:
        unbegun = "left to do: step 1: practice 'aiming', practice trials 1-2;" in said[0]
        # All trials are left where the first was reached, or not: it is repeated, or nothing is.
        none, some = r"nothing|practice trial 1\b", r"practice trials? \d|trials? \d"
        which = f"({none if unbegun else some}|no trial that is counted)"
        again = rf"repeated, as new attempts \(redo_trial\): {which}"
        assert re.search(again, said[0]), said[0]
    lost = check(lab, data, began, time.perf_counter())
    record_property(LOST, lost)
    assert max(lost, default=0.0) <= (BOTH_S if killed >= set(BOTH) else CHUNK / RATE_HZ)
    return killed


@pytest.mark.long
@pytest.mark.timeout(900)
@pytest.mark.parametrize(("number", "victims"), list(enumerate(DOZEN)))
def test_a_session_whose_processes_were_killed_comes_to_its_planned_end(
    lab: Lab, tmp_path: Path, number: int, victims: tuple[str, ...], record_property: Figures
) -> None:
    assert kill_and_go_on(lab, tmp_path, victims, number, record_property) == set(victims)


def shared_out(number: int) -> pytest.MarkDecorator:
    """Return in which of the laboratories something is tried: each process of a run has its own."""
    return pytest.mark.xdist_group(f"kills in laboratory {number % LABS}")


def numbered(count: int) -> list:
    return [pytest.param(number, marks=shared_out(number)) for number in range(count)]


@pytest.mark.timeout(900)
@pytest.mark.parametrize(
    "seed",
    [pytest.param(0, marks=pytest.mark.long)]
    + [pytest.param(seed, marks=[pytest.mark.soak, shared_out(seed)]) for seed in range(1, 60)],
)
def test_a_session_that_is_killed_again_and_again_comes_to_its_planned_end(
    lab: Lab, tmp_path: Path, seed: int, record_property: Figures
) -> None:
    """Whoever dies, and in whichever order, while it is run and while it is gone on with."""
    chance, began = random.Random(3000 + seed), time.perf_counter()
    killed = kill(lab, tmp_path, tuple(chance.sample(VICTIMS, 2)), chance)
    for _ in range(3):
        victims = tuple(chance.sample(VICTIMS, chance.choice([1, 2, 3])))
        killed |= kill(lab, tmp_path, victims, chance, "resume")
    assert killed
    go_on(lab, tmp_path)
    lost = check(lab, tmp_path, began, time.perf_counter())
    record_property(LOST, lost)
    assert max(lost, default=0.0) <= CHUNK / RATE_HZ


@pytest.mark.soak
@pytest.mark.timeout(900)
@pytest.mark.parametrize("victim", VICTIMS)
@pytest.mark.parametrize("number", numbered(60))
def test_sixty_kills_of_each_process(
    lab: Lab, tmp_path: Path, number: int, victim: str, record_property: Figures
) -> None:
    kill_and_go_on(lab, tmp_path, (victim,), 1000 + number, record_property)


@pytest.mark.soak
@pytest.mark.timeout(900)
@pytest.mark.parametrize("pair", PAIRS, ids="-".join)
@pytest.mark.parametrize("number", numbered(3))
def test_thirty_kills_of_two_processes(
    lab: Lab, tmp_path: Path, number: int, pair: tuple[str, str], record_property: Figures
) -> None:
    kill_and_go_on(lab, tmp_path, pair, 2000 + number, record_property)
