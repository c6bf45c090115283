"""A page of the documentation, and how each of its blocks is run.

A comment on the line above a block says what else is to be known of it:

    <!-- file: NAME -->       the block is the content of that file
    <!-- first: COMMAND -->   run before it, and not shown to readers; $STUDY, $DATA, $RECORDING and
                              $REPOSITORY are what conftest.py has made
    <!-- then: TEXT -->       run after it in the same program, and not shown to readers
    <!-- with: octave -->     what runs it, where the language is not what its name says
    <!-- installed: NAME=MODULE -->  a plugin that is installed from here on
    <!-- fails: STATUS -->    a command that is to end with that status
    <!-- runs: on and on -->  a program without an end; it is stopped after two seconds
    <!-- long: REASON -->     run by pytest -m long only
    <!-- desk: WHAT -->       on a terminal with a screen, where a person has two sticks (person.py)
    <!-- environment: one of its own -->  what is installed there is seen nowhere else
    <!-- rehearsed: HOW -->   as root, by a program that only says what it would do (REHEARSED)
    <!-- bare machine: WHY -->  run by .ci/run, which begins with such a machine
    <!-- not run: REASON -->  it cannot be run in a test, and why

A block without a language lists files that are there.

External links are only listed: other sites must not fail our tests.
"""

import importlib.util
import json
import os
import re
import shlex
import subprocess
import sys
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from xml.etree import ElementTree

from docs.person import Person
from fresh_environment import environment
from rehearsal import loaded
from ruamel.yaml import YAML
from simple_crane import CRANE
from windows import an_x_server

from labcrane.testing import main

ROOT = Path(__file__).parents[2]


def program(name: str) -> ModuleType:
    """Return a program of the folder of the documentation, imported."""
    spec = importlib.util.spec_from_file_location(name, ROOT / "docs" / f"{name}.py")
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


PAGES = sorted([ROOT / "README.md", ROOT / "plugins" / "README.md", *(ROOT / "docs").glob("*.md")])
PAGES += sorted((ROOT / "docs" / "own").glob("*.md"))

BLOCK = re.compile(
    r"(?P<marks>(?:^ *<!-- .+? -->\n)*)"
    r"^(?P<indent> *)```(?P<language>\w*)[^\n]*\n(?P<text>.*?)^(?P=indent)```$",
    re.MULTILINE | re.DOTALL,
)
NAMES = (
    "file|first|then|with|installed|fails|runs|long|desk|environment|rehearsed|bare machine|not run"
)
MARK = re.compile(rf"<!-- ({NAMES}): (.+?) -->")

RUNS_S = 2.0

COMMANDS = re.compile(r"(?:labcrane [^|&;<>$`]+\n)+")
"""Lines that need no shell."""

BASE = (
    """\
labcrane: 1
study: page
title: A page's study
rate_hz: 240
"""
    + CRANE
    + """\
tasks:
  aiming: {use: aiming, distances: [2], movements: 2}
  retrieval: {use: aiming, distances: [2], movements: 2}
feedback:
  sphere: {use: sphere}
sessions:
  - name: only
    steps:
      - block: {task: aiming, pairs: 1}
"""
)
"""What a page's parts of a protocol are put into."""


@dataclass(frozen=True)
class Block:
    """A block of code: what it says, in which language, where it is, and its marks."""

    text: str
    language: str
    line: int
    marks: Mapping[str, str]

    @property
    def needs(self) -> list[str]:
        """What must be installed here before it can be followed."""
        language = self.marks.get("with", self.language)
        found = [PROGRAMS[language][0]] if language in PROGRAMS else []
        if language == "r":
            found += re.findall(r"library\((\w+)\)", self.text)
        if "rehearsed" in self.marks:
            found += ["ufw", "root"]
        return [*found, "Xvfb"] if "desk" in self.marks else found

    @property
    def why_not(self) -> str | None:
        """Why it cannot be run."""
        return self.marks.get("not run")


def blocks(page: Path) -> list[Block]:
    """Return a page's blocks in order."""
    text = page.read_text()
    found = []
    for match in BLOCK.finditer(text):
        indent = match["indent"]
        lines = [line.removeprefix(indent) for line in match["text"].splitlines()]
        number = text[: match.start("language")].count("\n") + 1
        marks = dict(MARK.findall(match["marks"]))
        found.append(Block("\n".join(lines) + "\n", match["language"], number, marks))
    return found


class Reader:
    """Follows a page from top to bottom, in a folder of its own."""

    def __init__(self, folder: Path, recorded: Mapping[str, str]) -> None:
        self._folder = folder
        self._names: dict[str, object] = {"__name__": "page"}
        self._alone = False
        self._environment = {
            **os.environ,
            **recorded,
            "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
            "PYTHONPATH": str(folder),
            "PYTHON": sys.executable,
            "OCTAVE_PATH": str(Path(__file__).with_name("matlab")),
            "MPLBACKEND": "agg",
            "COLUMNS": "100",
        }

    def follow(self, block: Block) -> None:
        """Do what a block says; whatever goes wrong is raised."""
        self.prepare(block)
        marks, text = block.marks, block.text + block.marks.get("then", "")
        language = marks.get("with", block.language)
        if "runs" in marks:
            self._runs_on(text)
        elif "desk" in marks:
            self._sit_down(text)
        elif language == "sh":
            self._shell(text, int(marks.get("fails", "0")))
        elif language in PROGRAMS:
            self._program(language, text)
        elif not language:
            for line in text.splitlines():
                assert (self._folder / line).exists(), f"there is no {line}"
        elif "file" not in marks or language in PARSERS:
            self._read(language, text, block.line)

    def prepare(self, block: Block) -> None:
        """Do what marks ask for before the block itself."""
        marks = block.marks
        if command := marks.get("first"):
            self._shell(command)
        if point := marks.get("installed"):
            self._install(point)
        if name := marks.get("file"):
            path = self._folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(block.text)
        if "environment" in marks:
            self._make_environment()
        if "rehearsed" in marks:
            self._stand_in(REHEARSED)

    def _read(self, language: str, text: str, line: int) -> None:
        """Run Python here, check a protocol, parse anything else."""
        if language == "python":
            exec(compile(text, f"block at line {line}", "exec"), self._names)
        elif language == "yaml":
            self._check(text)
        else:
            PARSERS[language](text)

    def _make_environment(self) -> None:
        """Let commands from here on be those of a new environment, with no package index."""
        python = environment(self._folder / ".venv")
        self._environment |= {
            "PATH": f"{python.parent}:{self._environment['PATH']}",
            "PIP_NO_INDEX": "1",
            "PIP_NO_BUILD_ISOLATION": "0",  # as pip wants it: 0 for no isolation
        }
        self._alone = True

    def _stand_in(self, programs: Mapping[str, str]) -> None:
        """Let other programs answer to these names from here on."""
        bin_ = self._folder / "stand-ins"
        bin_.mkdir(exist_ok=True)
        for name, does in programs.items():
            (bin_ / name).write_text(f"#!/bin/sh\n{does}\n")
            (bin_ / name).chmod(0o755)
        self._environment["PATH"] = f"{bin_}:{self._environment['PATH']}"

    def _shell(self, text: str, status: int = 0) -> None:
        if COMMANDS.fullmatch(text) and not self._alone:
            # Each as a process of its own would load the same libraries again and again.
            found = [main(shlex.split(line)[1:]) for line in text.splitlines()]
            assert found == [0] * (len(found) - 1) + [status], f"{text}: ended with {found}"
            return
        done = subprocess.run(
            ["bash", "-euo", "pipefail", "-c", text],
            cwd=self._folder,
            env=self._environment,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == status, f"{text}\n{done.stdout}\n{done.stderr}"

    def _sit_down(self, text: str) -> None:
        """Run one command after the other on a terminal, with a person before it."""
        with an_x_server() as display:
            for command in text.splitlines():
                person = Person(command, self._folder, {**self._environment, "DISPLAY": display})
                status = person.sit()
                # What a doctor finds wrong with this computer is no fault of the page.
                bad = status != 0 and not (status == 1 and "labcrane doctor" in command)
                assert not bad, f"{command}: ended with {status}\n{person.read}"
                assert "Traceback" not in person.read, person.read

    def _runs_on(self, text: str) -> None:
        """Start a program that has no end, and stop it when it has run a while."""
        program = subprocess.Popen(
            [sys.executable, "-c", text], cwd=self._folder, env=self._environment
        )
        try:
            status = program.wait(RUNS_S)
        except subprocess.TimeoutExpired:
            return
        finally:
            program.kill()
            program.wait()
        raise AssertionError(f"it ended by itself, with exit code {status}")

    def _program(self, language: str, text: str) -> None:
        program, options, name = PROGRAMS[language]
        (self._folder / name).write_text(text)
        self._shell(f"{program} {options} {name}")

    def _install(self, point: str) -> None:
        """Leave in the folder what pip would leave of a plugin."""
        name, module = point.split("=")
        metadata = self._folder / f"{module}-1.dist-info"
        metadata.mkdir(exist_ok=True)
        (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {module}\nVersion: 1\n")
        (metadata / "entry_points.txt").write_text(f"[labcrane]\n{name} = {module}\n")

    def _check(self, text: str) -> None:
        """Check a protocol, or a part of one put into the page's study."""
        yaml = YAML()
        part = yaml.load(text) or {}  # of comments alone
        if "labcrane" not in part:
            part = {**yaml.load(BASE), **part}
        path = self._folder / "page.yaml"
        with path.open("w") as file:
            yaml.dump(part, file)
        study = loaded(path)
        for choice in (*study.views.values(), *study.sounds.values(), *study.cues.values()):
            choice.build(study.machine)


REHEARSED = {"sudo": 'exec "$@"', "ufw": 'exec /usr/sbin/ufw --dry-run "$@"'}
"""What a page says that would change the computer, and what is done instead."""

PROGRAMS = {
    "r": ("Rscript", "", "page.R"),
    "octave": ("octave-cli", "--norc -q", "page.m"),
}
"""What runs a language, its options, and the file the block is put into."""

PARSERS = {
    "toml": tomllib.loads,
    "json": json.loads,
    "xml": ElementTree.fromstring,
    "regex": lambda text: [re.compile(line) for line in text.splitlines()],
}
"""What makes sure that a block is what its language says."""
