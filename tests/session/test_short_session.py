"""One short session from beginning to end, as a laboratory runs it: the quick tests' own.

It has a launcher, LSL, the pages, a kill and a resume, and an export that another program reads.
Longer ones are in ``tests/faults`` and ``tests/study_day``.
"""

import re
import sys
import urllib.request
from pathlib import Path

import pylsl
import pytest
import pyxdf
from faults.sessions import finished, kill_all, labcrane, unique, wait_for
from simple_crane import FORM

from labcrane import open_recording
from labcrane.recording.paths import parts
from labcrane.recording.xdf.reader import read_xdf

STUDY = (
    """\
labcrane: 1
study: {study}
title: A short session
rate_hz: 240
"""
    + FORM
    + """\
tasks:
  waiting: {{use: until_told}}
sessions:
  - name: only
    steps:
      - block: {{task: waiting}}
on_fault: {{session_died: redo_trial}}
"""
)
TASK = """\
import numpy as np
from pathlib import Path
from labcrane import Settings, Signal, Task, hookimpl, offer
from labcrane.core import Phase, PlannedTrial, TrialStatus

labcrane_api = 1


class UntilTold(Task):
    # Trials last until a file is there: they cannot end before the test has seen them.

    results = (Signal("duration", "s", definition="from the start of the trial to its end"),)

    def factors(self):
        return {}

    def plan(self, levels):
        return [PlannedTrial({}, expected_s=1.0) for _ in range(3)]

    def lift_limits(self):
        pass

    def evaluate(self, frame):
        told = Path("told").exists()
        results = {"duration": frame.elapsed} if told else {}
        return TrialStatus(Phase.SUCCESS if told else Phase.RUNNING, np.zeros(0), (), results)


@hookimpl
def labcrane_tasks():
    return [offer("until_told", Settings, lambda settings, machine: UntilTold())]
"""


@pytest.mark.skipif(sys.platform == "win32", reason="its processes are killed by Unix's signals")
def test_a_killed_session_is_resumed_and_all_that_others_have_seen_is_in_the_record(
    tmp_path: Path,
) -> None:
    study = unique("short")
    (tmp_path / "study.yaml").write_text(STUDY.format(study=study))
    (tmp_path / "plugins").mkdir()
    (tmp_path / "plugins" / "until_told.py").write_text(TASK)
    words = ("study.yaml", "--participant", "P001", "--simulate", "--data", "data")
    journal = tmp_path / "data" / "P001-SIMULATED" / "ses-01_run.xdf"
    with (tmp_path / "said").open("w") as said:
        run = labcrane("run", *words, "--page", cwd=tmp_path, stdout=said)
    try:
        wait_for(
            lambda: run.poll() is not None or "participant's" in (tmp_path / "said").read_text()
        )
        links = re.findall(r"page: (http\S+)", (tmp_path / "said").read_text())
        assert len(links) == 2, (tmp_path / "said").read_text()
        for link in links:
            browser = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())
            with browser.open(link, timeout=60) as answer:
                assert b"<html" in answer.read()
        mine = f"name='labcrane.state' and starts-with(source_id,'labcrane/{study}/')"
        (found,) = pylsl.resolve_bypred(mine, 1, 60.0)
        samples, stamps = pylsl.StreamInlet(found, recover=False).pull_chunk(60.0, max_samples=50)
    finally:
        if run.poll() is None:
            kill_all(run)
    (tmp_path / "told").touch()
    assert len(stamps) == 50
    (broken,) = parts(journal)
    before = broken.read_bytes()

    finished(labcrane("resume", *words, "--no-page", cwd=tmp_path))
    assert broken.read_bytes() == before, "what was written before stays as it was"
    session = open_recording(tmp_path / "data" / "P001-SIMULATED" / "P001-SIMULATED.h5").session(1)
    trials = session.trials
    assert trials["trial"].astype(int).tolist() == [1, 1, 2, 3], "the first was cut off"
    assert (trials["outcome"] == "success").tolist() == [False, True, True, True]
    assert session.events["data"].iloc[-1] == {"reason": "complete", "owed": ""}
    state = session.streams["state"]
    rows = dict(zip(state.time.tolist(), state.data.to_numpy().tolist(), strict=True))
    assert [rows[stamp] for stamp in stamps] == samples
    assert read_xdf(broken)

    exported = labcrane(
        "export", "data", "--to", "xdf", "--include", "simulated", "--out", "out", cwd=tmp_path
    )
    finished(exported)
    (path,) = (tmp_path / "out").rglob("*.xdf")
    streams, _ = pyxdf.load_xdf(path, dejitter_timestamps=False, synchronize_clocks=False)
    (read,) = (one for one in streams if one["info"]["name"] == ["labcrane.state"])
    assert read["time_series"].tolist() == state.data.to_numpy().tolist()
