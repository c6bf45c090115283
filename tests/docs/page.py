"""A page of the documentation, and how each of its blocks is run.

A comment on the line above a block says what else is to be known of it:

    <!-- file: NAME -->       the block is the content of that file
    <!-- first: COMMAND -->   run before it, and not shown to readers; $STUDY, $DATA, $RECORDING and
                              $REPOSITORY are what conftest.py has made
    <!-- with: octave -->     what runs it, where the language is not what its name says
    <!-- installed: NAME=MODULE -->  a plugin that is installed from here on
    <!-- fails: STATUS -->    a command that is to end with that status
    <!-- runs: on and on -->  a program without an end; it is stopped after two seconds
    <!-- long: REASON -->     run by pytest -m long only
    <!-- not run: REASON -->  it cannot be run in a test, and why
"""

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
from xml.etree import ElementTree

from ruamel.yaml import YAML

from labcrane.cli.app import main
from labcrane.registry import discover
from labcrane.study import load

ROOT = Path(__file__).parents[2]
PAGES = sorted([ROOT / "README.md", ROOT / "plugins" / "README.md", *(ROOT / "docs").glob("*.md")])
PAGES += sorted((ROOT / "docs" / "own").glob("*.md"))

BLOCK = re.compile(
    r"(?P<marks>(?:^ *<!-- .+? -->\n)*)"
    r"^(?P<indent> *)```(?P<language>\w*)[^\n]*\n(?P<text>.*?)^(?P=indent)```$",
    re.MULTILINE | re.DOTALL,
)
MARK = re.compile(r"<!-- (file|first|with|installed|fails|runs|long|not run): (.+?) -->")

RUNS_S = 2.0

COMMANDS = re.compile(r"(?:labcrane [^|&;<>$`]+\n)+")
"""Lines that need no shell."""

BASE = """\
labcrane: 1
study: page
title: A page's study
rate_hz: 240
machine: ch8
input: {use: dual_joystick}
scheme:
  use: joint_velocity
  map: {slew: left.x, elbow: left.y, wrist: right.x, shoulder: -right.y}
dynamics: {use: kinematic_crane}
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
"""What a page's parts of a protocol are put into."""


@dataclass(frozen=True)
class Block:
    """A block of code: what it says, in which language, where it is, and its marks."""

    text: str
    language: str
    line: int
    marks: Mapping[str, str]

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
        self._environment = {
            **os.environ,
            **recorded,
            "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
            "PYTHONPATH": str(folder),
            "MPLBACKEND": "agg",
            "COLUMNS": "100",
        }

    def follow(self, block: Block) -> None:
        """Do what a block says; whatever goes wrong is raised."""
        marks = block.marks
        if command := marks.get("first"):
            self._shell(command)
        if point := marks.get("installed"):
            self._install(point)
        if name := marks.get("file"):
            path = self._folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(block.text)
        language = marks.get("with", block.language)
        if "runs" in marks:
            self._runs_on(block.text)
        elif language == "python" and "file" not in marks:
            exec(compile(block.text, f"block at line {block.line}", "exec"), self._names)
        elif language == "sh":
            self._shell(block.text, int(marks.get("fails", "0")))
        elif language == "r":
            self._program("Rscript", "page.R", block.text)
        elif language == "octave":
            self._program("octave", "page.m", block.text, "--no-gui", "--norc", "-q")
        elif language == "yaml" and "file" not in marks:
            self._check(block.text)
        else:
            PARSERS.get(language, lambda text: None)(block.text)

    def _shell(self, text: str, status: int = 0) -> None:
        if COMMANDS.fullmatch(text):
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

    def _program(self, program: str, name: str, text: str, *options: str) -> None:
        (self._folder / name).write_text(text)
        self._shell(" ".join([program, *options, name]))

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
        part = yaml.load(text)
        if "labcrane" not in part:
            part = {**yaml.load(BASE), **part}
        path = self._folder / "page.yaml"
        with path.open("w") as file:
            yaml.dump(part, file)
        study = load(path, discover())
        for choice in (*study.views.values(), *study.sounds.values(), *study.cues.values()):
            choice.build(study.machine)


PARSERS = {
    "toml": tomllib.loads,
    "json": json.loads,
    "xml": ElementTree.fromstring,
}
"""What makes sure that a block is what its language says."""
