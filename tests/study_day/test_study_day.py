"""A study day as a laboratory has it, on whatever system this is: by commands, in real time."""

import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pandas as pd
import psutil
import pylsl
import pytest
import pyxdf
from needs import missing
from scipy.io import loadmat
from simple_crane import FORM

from labcrane import open_recording

ENGINE = "kinematic_crane" if missing("mujoco") else "mujoco_crane"
STUDY = (
    """\
labcrane: 1
study: {study}
title: Prüfung auf «jedem» System
rate_hz: 240
"""
    + FORM.replace("kinematic_crane", ENGINE)
    + """\
tasks:
  aiming: {{use: aiming, distances: [2, 4], movements: 2, limit_s: 1.5}}
sessions:
  - name: only
    steps:
      - block: {{task: aiming}}
on_fault: {{session_died: redo_trial}}
"""
)
PATIENCE_S = 400.0
HEARD = 240
"""Samples that the witness has when the power is cut: a second of them."""

pytestmark = [pytest.mark.long, pytest.mark.timeout(1500)]


class Lab:
    """A folder as people name them, and the commands typed in it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder / "Größe & Übung"
        self.folder.mkdir()
        self.study = f"day-{time.time_ns()}"
        text = STUDY.format(study=self.study)
        (self.folder / "study.yaml").write_text(text, encoding="utf-8")

    def start(self, *words: str) -> "subprocess.Popen[str]":
        return subprocess.Popen(
            [sys.executable, "-u", "-m", "labcrane", *words],
            cwd=self.folder,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            encoding="utf-8",
        )

    def labcrane(self, *words: str) -> str:
        process = self.start(*words)
        said, _ = process.communicate(timeout=PATIENCE_S)
        assert process.returncode == 0, said
        return said


def run(what: str, *words: str) -> tuple[str, ...]:
    return (what, "study.yaml", "--participant", "P001", "--simulate", "--data", "data", *words)


class Witness:
    """Another program on the LSL network: keeps every state sample that reaches it."""

    def __init__(self, study: str) -> None:
        self.heard: dict[float, list[float]] = {}
        self._over = threading.Event()
        self._study = study
        self._thread = threading.Thread(target=self._listen)

    def __enter__(self) -> "Witness":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()

    def _listen(self) -> None:
        named = f"name='labcrane.state' and starts-with(source_id,'labcrane/{self._study}/')"
        inlet = None
        while not self._over.is_set():
            if inlet is None:
                if found := pylsl.resolve_bypred(named, 1, 0.2):
                    inlet = pylsl.StreamInlet(found[0], recover=False)
                continue
            try:
                samples, stamps = inlet.pull_chunk(0.0)
            except pylsl.util.LostError:
                inlet = None
                continue
            self.heard.update(zip(stamps, samples, strict=True))
            self._over.wait(0.01)


def kill(launcher: "subprocess.Popen[str]") -> None:
    """Kill a launcher and all that it has started, as a power cut does."""
    processes = [psutil.Process(launcher.pid)]
    processes += processes[0].children(recursive=True)
    for process in processes:
        process.kill()
    psutil.wait_procs(processes, timeout=240)
    launcher.communicate()


@pytest.fixture(scope="module")
def day(tmp_path_factory: pytest.TempPathFactory) -> tuple[Lab, dict[float, list[float]], str]:
    """Record a session until it is cut off, recover it, and go on with it."""
    lab = Lab(tmp_path_factory.mktemp("day"))
    assert "is fine" in lab.labcrane("check", "study.yaml")
    with Witness(lab.study) as witness:
        launcher = lab.start(*run("run"))
        deadline = time.monotonic() + PATIENCE_S
        while len(witness.heard) < HEARD and time.monotonic() < deadline:
            if launcher.poll() is not None:
                break
            time.sleep(0.01)
        assert launcher.poll() is None, launcher.communicate()
        kill(launcher)
    recovered = lab.labcrane("recover", "data")
    lab.labcrane(*run("resume"))
    return lab, witness.heard, recovered


def recording(lab: Lab) -> Path:
    (path,) = (lab.folder / "data").rglob("*.h5")
    return path


def test_what_another_program_has_heard_before_the_kill_is_in_the_file(day) -> None:
    lab, heard, recovered = day
    assert "P001-SIMULATED.h5" in recovered
    session = open_recording(recording(lab)).session(1)
    state = session.streams["state"]
    rows = dict(zip(state.time.tolist(), state.data.to_numpy().tolist(), strict=True))
    assert len(heard) >= HEARD
    for stamp, sample in heard.items():
        assert rows[stamp] == sample


def test_the_session_is_gone_on_with_and_every_movement_is_there(day) -> None:
    lab, *_ = day
    session = open_recording(recording(lab)).session(1)
    names = session.events["name"].tolist()
    assert names.count("session.start") == 2
    assert names[-1] == "session.end"
    assert (np.diff(session.streams["state"].time) > 0.0).all()
    assert ENGINE in session.context["protocol"]
    assert session.context["title"] == "Prüfung auf «jedem» System"


def test_tables_xdf_and_matlab_hold_the_same_session(day) -> None:
    lab, *_ = day
    session = open_recording(recording(lab)).session(1)
    for kind in ("tables", "xdf", "matlab"):
        lab.labcrane("export", "data", "--to", kind, "--out", kind, "--include", "simulated")
    tables = list((lab.folder / "tables").rglob("*.csv"))
    trials = next(pd.read_csv(path) for path in tables if "trials" in path.name)
    assert len(trials) == len(session.trials)
    (xdf,) = (lab.folder / "xdf").rglob("*.xdf")
    streams, _ = pyxdf.load_xdf(xdf, dejitter_timestamps=False, synchronize_clocks=False)
    by_name = {stream["info"]["name"][0]: stream for stream in streams}
    state = next(each for name, each in by_name.items() if name.endswith("state"))
    values = session.streams["state"].data.to_numpy().astype(state["time_series"].dtype)
    np.testing.assert_array_equal(state["time_series"], values)
    (matlab,) = (lab.folder / "matlab").rglob("*.mat")
    assert loadmat(matlab, struct_as_record=False, squeeze_me=True)
