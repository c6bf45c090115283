"""SIGKILL of a session at random moments of its life: nothing recorded is lost."""

import json
import random
import shutil
import time
from pathlib import Path

import numpy as np
import pytest
import pyxdf
from faults.sessions import (
    STUDY,
    a_witness,
    contents,
    finished,
    kill_all,
    labcrane,
    run_second,
    session_process,
    unique,
    wait_for,
)

from labcrane import open_recording
from labcrane.errors import OutdatedRecordingWarning
from labcrane.recording.participant_file.recover import backlog, recover
from labcrane.recording.xdf.reader import read_xdf
from labcrane.session.postprocess import conclude
from labcrane.session.resume import progress

SIXTY = [pytest.mark.soak, pytest.mark.timeout(1500)]
"""The first of these tests waits for all sessions to be killed and recovered."""

NUMBERS = [6, pytest.param(18, marks=pytest.mark.long), pytest.param(60, marks=SIXTY)]


@pytest.fixture(scope="module", params=NUMBERS)
def killed(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory):
    """Kill a session at many moments, with a witness; return what became of it."""
    folder = tmp_path_factory.mktemp("killed")
    study = unique("kill")
    protocol = folder / "study.yaml"
    protocol.write_text(STUDY.format(study=study))
    prepared = folder / "prepared"
    arguments = ("--participant", "P001", "--simulate", "--fast", "--data", prepared)
    finished(labcrane("run", protocol, *arguments))
    chance = random.Random(20261)
    runs = []
    with a_witness(study, folder / "seen.jsonl"):
        whole = _whole_journal(protocol, prepared, folder / "whole")
        for number in range(request.param):
            data = folder / f"run-{number}"
            shutil.copytree(prepared, data)
            began = time.perf_counter()
            launcher = run_second(protocol, data)
            victim = _kill(STAGES[number % len(STAGES)], launcher, data, whole, chance)
            runs.append((data, victim, began, time.perf_counter()))
    lines = (folder / "seen.jsonl").read_text().splitlines()
    samples = [json.loads(line) for line in lines if line.startswith("[") and line.endswith("]")]
    return prepared, runs, dict(samples)


STAGES = ("start", *["session"] * 4, "conclusion")
"""Where a kill falls. Within it the moment is random; a slow computer does not shift it."""


def _kill(stage: str, launcher, data: Path, whole: int, chance: random.Random) -> str:
    """Kill at a random moment of a stage; return what was killed: the session, all, or nobody."""
    journal = data / "P001-SIMULATED" / "ses-02_run.xdf"
    if stage == "start":
        time.sleep(chance.uniform(0.0, 1.5))
    elif stage == "session":
        size = chance.uniform(0.0, whole)  # frames are written at an even pace
        wait_for(lambda: launcher.poll() is not None or _size(journal) >= size)
        time.sleep(chance.uniform(0.0, 0.008))  # anywhere within a tick
    else:
        wait_for(lambda: launcher.poll() is not None or _size(journal) >= 0.9 * whole)
        wait_for(lambda: launcher.poll() is not None or session_process(launcher) is None)
        time.sleep(chance.uniform(0.0, 0.5))
    victim = session_process(launcher)
    if victim is not None:
        victim.kill()
        launcher.communicate(timeout=240)  # it concludes what was recorded
        return "session"
    if launcher.poll() is None:
        kill_all(launcher)
        return "all"
    launcher.communicate()
    return "nobody"


def _size(journal: Path) -> int:
    return journal.stat().st_size if journal.exists() else 0


def _whole_journal(protocol: Path, prepared: Path, data: Path) -> int:
    """Return the size of a session's journal when nobody kills it."""
    shutil.copytree(prepared, data)
    launcher = run_second(protocol, data)
    finished(launcher)
    return _size(data / "P001-SIMULATED" / "ses-02_run.xdf")


@pytest.mark.slow
def test_kills_hit_the_session_in_all_its_stages(killed) -> None:
    _, runs, _ = killed
    victims = [victim for _, victim, *_ in runs]
    assert victims.count("session") >= len(runs) // 2
    assert victims.count("all") >= len(runs) // 10  # the start and the conclusion


@pytest.mark.slow
def test_every_recording_opens_and_no_frame_is_missing(killed) -> None:
    _, runs, seen = killed
    witnessed = outdated = 0
    for data, _, began, ended in runs:
        file = data / "P001-SIMULATED" / "P001-SIMULATED.h5"
        behind = backlog(file)
        assert all(f"labcrane recover {file.parent}" in said for said in behind.values())
        if behind:
            with pytest.warns(OutdatedRecordingWarning, match="session 2"):
                open_recording(file)
        outdated += bool(behind)
        for done in recover(data, conclude):
            assert done.problem == ""
        heard = {t: sample for t, sample in seen.items() if began <= t <= ended}
        assert backlog(file) == {}
        recording = open_recording(file)
        if 2 not in recording.sessions:
            assert not heard, "what was sent was written before"
            continue
        session = recording.session(2)
        state = session.streams["state"]
        ticks = session.streams["loop"].data["tick"].to_numpy()
        np.testing.assert_array_equal(ticks, np.arange(len(ticks)))
        rows = dict(zip(state.time.tolist(), state.data.to_numpy().tolist(), strict=True))
        for stamp, sample in heard.items():
            assert rows[stamp] == sample
        witnessed += len(heard)
    assert outdated, "every kill was before the first frame or after the last"
    assert witnessed > 240, "the witness has hardly seen anything"


@pytest.mark.slow
def test_pyxdf_reads_every_journal(killed) -> None:
    _, runs, _ = killed
    journals = [journal for data, *_ in runs for journal in data.rglob("ses-02_*.xdf")]
    assert len(journals) >= len(runs) // 4
    for journal in journals:
        streams, _ = pyxdf.load_xdf(journal, dejitter_timestamps=False)
        ours = {stream.header.name: stream for stream in read_xdf(journal).streams}
        for theirs in streams:
            (name,) = theirs["info"]["name"]
            if name != "labcrane.check":  # which our reader uses up
                assert len(theirs["time_stamps"]) == len(ours[name].stamps)


@pytest.mark.slow
def test_no_earlier_session_changes(killed) -> None:
    prepared, runs, _ = killed
    name = Path("P001-SIMULATED")
    before = contents(prepared / name / "P001-SIMULATED.h5", "ses-01")
    journal = (prepared / name / "ses-01_run.xdf").read_bytes()
    for data, *_ in runs:
        assert contents(data / name / "P001-SIMULATED.h5", "ses-01") == before
        assert (data / name / "ses-01_run.xdf").read_bytes() == journal


def _interrupted(data: Path) -> bool:
    """Whether the second session was killed in the middle of a movement."""
    journal = data / "P001-SIMULATED" / "ses-02_run.xdf"
    trial = progress(journal, ["slew"]).interrupted if journal.exists() else None
    return trial is not None and trial["counted"]


@pytest.mark.slow
def test_a_killed_session_is_gone_on_with(killed) -> None:
    _, runs, _ = killed
    data = next(data for data, victim, *_ in runs if victim == "session" and _interrupted(data))
    protocol = data.parent / "study.yaml"
    arguments = ("--participant", "P001", "--session", 2, "--simulate", "--data", data)
    finished(labcrane("resume", protocol, *arguments))
    session = open_recording(data / "P001-SIMULATED" / "P001-SIMULATED.h5").session(2)
    assert session.events["name"].tolist().count("session.start") == 2
    assert session.events["name"].tolist()[-1] == "session.end"
    trials = session.trials
    assert "interrupted" in set(trials["outcome"])
    last = trials.groupby("trial").tail(1)
    assert set(last["outcome"]) <= {"success", "timeout"}
    assert len(last) == 3  # one movement in the first block, and two in the second
