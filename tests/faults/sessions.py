"""Short sessions in processes of their own, to be killed."""

import hashlib
import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import h5py
import psutil
from rehearsal import simulated_file
from simple_crane import FORM

from labcrane import open_recording
from labcrane.recording import SessionRecord

STUDY = (
    """\
labcrane: 1
study: {study}
title: A study that is killed
rate_hz: 240
"""
    + FORM
    + """\
tasks:
  aiming: {{use: aiming, distances: [2], movements: 1, limit_s: 0.3}}
sessions:
  - name: first
    steps:
      - block: {{task: aiming, pairs: 1}}
  - name: second
    steps:
      - block: {{task: aiming, pairs: 1}}
      - break: {{seconds: 0.2}}
      - block: {{task: aiming}}
on_fault: {{session_died: redo_trial}}
"""
)


def labcrane(*arguments: object, **options: object) -> "subprocess.Popen[str]":
    """Start labcrane as a user does."""
    pipes = {
        "stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.STDOUT,
    }  # fmt: skip
    return subprocess.Popen(
        [sys.executable, "-m", "labcrane", *map(str, arguments)],
        text=True,
        **pipes | options,
    )


def finished(process: "subprocess.Popen[str]") -> str:
    """Wait for a process that ends without an error; return what it has said."""
    said = process.communicate(timeout=240)[0]
    assert process.returncode == 0, said
    return said


def killed_and_resumed(folder: Path, study: str, enough: float) -> SessionRecord:
    """Kill a simulated session whose journal has so many bytes; return what resuming it left."""
    protocol, data = folder / "study.yaml", folder / "data"
    protocol.write_text(study)
    who = ("--participant", "P001", "--simulate", "--data", data)
    launcher = labcrane("run", protocol, *who)
    journal = data / "P001-SIMULATED" / "ses-01_run.xdf"
    wait_for(lambda: journal.exists() and journal.stat().st_size > enough)
    victim = session_process(launcher)
    assert victim is not None
    victim.kill()
    launcher.communicate(timeout=240)
    finished(labcrane("resume", protocol, *who))
    return open_recording(data / "P001-SIMULATED" / "P001-SIMULATED.h5").session(1)


def put_recorded(folder: Path, needs: str, *, limit_s: int, **on_fault: str) -> None:
    """Write a study whose controls are those of a simulated session, which is run before."""
    text = STUDY.format(study=unique(folder.name))
    simulated_file(folder, text)
    recorded = "{use: recorded, file: data/P001-SIMULATED/P001-SIMULATED.h5}"
    text = text.replace("{use: dual_joystick}", recorded)
    text = text.replace("limit_s: 0.3", f"limit_s: {limit_s}")
    faults = "".join(f", {name}: {what}" for name, what in on_fault.items())
    text = text.replace("session_died: redo_trial", f"session_died: redo_trial{faults}")
    (folder / "study.yaml").write_text(text + needs)


class Conversation:
    """What a launched session prints, and what it is told."""

    def __init__(self, process: "subprocess.Popen[str]") -> None:
        self.process = process
        self.said: list[str] = []
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        for line in self.process.stdout:
            self.said.append(line.strip())

    def until(self, words: str, times: int = 1) -> None:
        wait_for(lambda: sum(words in line for line in self.said) >= times)

    def order(self, words: str) -> None:
        self.process.stdin.write(words + "\n")
        self.process.stdin.flush()

    def end(self) -> str:
        self.process.wait(240)
        self._reader.join()
        self.process.stdout.close()
        self.process.stdin.close()
        return "\n".join(self.said)


def talking(folder: Path) -> tuple["subprocess.Popen[str]", Conversation]:
    """Start a pilot session of the study in a folder; return its process and its terminal."""
    process = labcrane(
        "run", "study.yaml", "--participant", "P001", "--local", "--pilot",
        cwd=folder, stdin=subprocess.PIPE,
    )  # fmt: skip
    return process, Conversation(process)


def run_second(protocol: Path, data: Path) -> "subprocess.Popen[str]":
    """Start the second session in real time, as launcher, session and perhaps recorder."""
    return labcrane(
        "run", protocol, "--participant", "P001", "--session", 2, "--simulate", "--data", data
    )


def session_process(launcher: "subprocess.Popen[str]") -> psutil.Process | None:
    """Return the session process of a launcher, while there is one."""
    for child in _children(launcher):
        try:
            if "labcrane.launcher.session_process" in child.cmdline() and child.is_running():
                return child
        except psutil.NoSuchProcess:
            continue
    return None


def recorders(launcher: "subprocess.Popen[str]") -> list[psutil.Process]:
    """Return the recorder processes of a launcher that write a journal of streams."""
    return [child for child in _children(launcher) if journals(child)]


def journals(process: psutil.Process) -> list[Path]:
    """Return the journals of streams that a process holds open.

    A process that is still importing holds modules open whose names say "_streams" too.
    """
    paths = [Path(file.path) for file in _files(process)]
    return [path for path in paths if path.suffix == ".xdf" and "_streams" in path.name]


def spares(launcher: "subprocess.Popen[str]") -> list[psutil.Process]:
    """Return the recorder processes of a launcher that have loaded liblsl, and wait."""
    found = []
    writing = {one.pid for one in recorders(launcher)}
    for child in _children(launcher):
        with suppress(psutil.NoSuchProcess, psutil.ZombieProcess):
            waits = "labcrane.streams.recorder.process" in child.cmdline()
            maps = [each.path for each in child.memory_maps()]
            if waits and child.pid not in writing and any("liblsl" in path for path in maps):
                found.append(child)
    return found


def recorder_process(launcher: "subprocess.Popen[str]") -> psutil.Process | None:
    """Return one of the recorder processes of a launcher, while there is one."""
    return next(iter(recorders(launcher)), None)


def _files(process: psutil.Process) -> list[Any]:
    try:
        return process.open_files()
    except (psutil.NoSuchProcess, psutil.AccessDenied):
        return []


def _children(launcher: "subprocess.Popen[str]") -> list[psutil.Process]:
    try:
        return psutil.Process(launcher.pid).children()
    except psutil.NoSuchProcess:
        return []


def kill_all(launcher: "subprocess.Popen[str]") -> None:
    """Kill a launcher and whatever it has started."""
    processes = [psutil.Process(launcher.pid)]
    processes += processes[0].children(recursive=True)
    for process in processes:
        with suppress(psutil.NoSuchProcess):  # it ends by itself when its launcher has gone
            process.kill()
    psutil.wait_procs(processes, timeout=240)
    launcher.communicate()


@contextmanager
def a_witness(study: str, into: Path) -> Iterator[None]:
    """Let another process write down what it receives of a study's sessions."""
    program = [sys.executable, str(Path(__file__).with_name("witness.py")), study]
    with into.open("w") as file:
        process = subprocess.Popen(program, stdout=file)
        try:
            yield
            process.terminate()  # it takes what is still under way
            assert process.wait(timeout=240) == 0
        finally:
            process.kill()
            process.wait()


@contextmanager
def program(name: str, *arguments: str, into: Path) -> Iterator[None]:
    """Run a program of this folder that says when it is ready, and write down what it says."""
    with into.open("w") as file:
        process = subprocess.Popen(
            [sys.executable, str(Path(__file__).with_name(name)), *arguments], stdout=file
        )
        try:
            wait_for(lambda: into.read_text().startswith("ready"))
            yield
        finally:
            process.kill()
            process.wait()


def witnessed(path: Path) -> dict[str, set[int]]:
    """Return the counts that a witness of a device has seen, by stream."""
    found: dict[str, set[int]] = {}
    for line in path.read_text().splitlines()[1:]:
        if line.endswith("]"):
            name, counts = json.loads(line)
            found.setdefault(name, set()).update(counts)
    return found


def contents(path: Path, group: str) -> dict[str, str]:
    """Return a hash of every dataset and every attribute below a group of a participant file."""
    found: dict[str, str] = {}

    def look(name: str, node: h5py.HLObject) -> None:
        for key, value in node.attrs.items():
            found[f"{name}@{key}"] = repr(value)
        if isinstance(node, h5py.Dataset):
            values = node.asstr("utf-8")[()] if node.dtype.kind in "OS" else node[()]
            data = repr(values.tolist()) if hasattr(values, "tolist") else repr(values)
            found[name] = hashlib.sha256(data.encode()).hexdigest()

    with h5py.File(path) as file:
        look("", file[group])
        file[group].visititems(look)
    return found


def wait_for(condition: object, patience_s: float = 240.0) -> None:
    """Wait until something has come about in another process; fail when it does not."""
    deadline = time.monotonic() + patience_s
    while not condition():
        assert time.monotonic() < deadline, "it did not come about"
        time.sleep(0.005)


def unique(word: str) -> str:
    """Return a study name that no other test run uses."""
    return f"{word}-{os.getpid()}-{time.monotonic_ns() % 10**6}"
