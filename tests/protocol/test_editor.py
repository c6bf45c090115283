"""What is found in a protocol, in an editor, on the supervisor's page and on the terminal."""

import json
import random
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from language_client import Editor
from needs import needs
from wrong_protocols import PROTOCOLS, SKELETONS, Wrong, faults, right

from labcrane.cli.app import main
from labcrane.protocol.study import load
from labcrane.registry.hookspecs import roles_by_key
from labcrane.registry.registry import Registry, discover

MODELINE = "# yaml-language-server: $schema=protocol.schema.json\n"
AIMING = (PROTOCOLS / "aiming" / "protocol.yaml").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def registry() -> Registry:
    return discover()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A study's folder as somebody has set it up for an editor."""
    shutil.copytree(PROTOCOLS / "aiming", tmp_path / "study")
    assert main(["schema", "--out", str(tmp_path / "study" / "protocol.schema.json")]) == 0
    return tmp_path / "study"


@pytest.fixture
def yaml_server() -> Sequence[str]:
    """The server that editors use."""
    return ["yaml-language-server", "--stdio"]


def told(path: Path, capsys: pytest.CaptureFixture[str]) -> list[dict[str, Any]]:
    """Return what ``labcrane check --json`` finds."""
    capsys.readouterr()
    main(["check", str(path), "--json"])
    found: list[dict[str, Any]] = json.loads(capsys.readouterr().out)["findings"]
    return found


def drawn(registry: Registry, count: int, seed: int) -> list[Wrong]:
    """Return wrong protocols of a study that says all there is, and of the aiming study."""
    found: list[Wrong] = []
    for study, text in (*((each, right(each, registry)) for each in SKELETONS), ("aiming", AIMING)):
        found += random.Random(seed).sample(list(faults(study, text, seed)), count)
    return found


def place(text: str, word: str) -> tuple[int, int]:
    """Return line and column, from 1, of the first letter behind a word."""
    before = text[: text.index(word) + len(word)]
    return before.count("\n") + 1, len(before) - before.rfind("\n")


BY_SCHEMA = {
    "an unknown key": ("rate_hz: 240", "raet_hz: 240", "raet_hz", "raet_hz is not allowed"),
    "an unknown setting": ("at: target, far", "at: target, fra", "fra", "fra is not allowed"),
    "an offer that is not installed": ("use: sphere", "use: spere", "spere", "is not accepted"),
    "a word where a number belongs": ("width: 0.5", "width: wide", "wide", "pattern"),
    "a number out of its range": ("dead_zone: 0.05", "dead_zone: 1.5", "1.5", "exclusive maximum"),
    "an unknown choice": ("end: rest_inside", "end: rest_outside", "rest_outside", "not accepted"),
    "an unknown rule of order": ("pairs: shuffled", "pairs: shufled", "shufled", "not accepted"),
    "what happens at a fault": ("input_lost: pause", "input_lost: wait", "wait", "not accepted"),
    "no list where one belongs": ("none: []", "none: 5", "none: 5", 'Expected "array"'),
    "an unknown step": ("- block: {task", "- blok: {task", "blok", 'must be "consent"'),
    "no pair of circles": ("feedback: group}", "feedback: group, pairs: 0}", "pairs: 0", "minimum"),
    "a name of the study that is none": ("study: aiming", "study: Aiming!", "Aiming!", "pattern"),
}  # fmt: skip
"""What a schema can say: what is right, what is wrong, what is marked, and what is said of it."""


@pytest.mark.long
@needs("yaml-language-server")
def test_the_yaml_language_server_marks_what_a_schema_can_say_in_its_line_and_nothing_else(
    folder: Path, registry: Registry, yaml_server: Sequence[str], capsys: pytest.CaptureFixture[str]
) -> None:
    with Editor(yaml_server, folder) as editor:
        for study in sorted(PROTOCOLS.glob("*/protocol.yaml")):
            right = folder / f"{study.parent.name}.yaml"
            right.write_text(MODELINE + study.read_text(encoding="utf-8"), encoding="utf-8")
            assert editor.open(right) == []
        for number, (right, wrong, marked, said) in enumerate(BY_SCHEMA.values()):
            assert AIMING.count(right) == 1
            path = folder / f"wrong{number}.yaml"
            text = MODELINE + AIMING.replace(right, wrong)
            path.write_text(text, encoding="utf-8")
            line = text[: text.index(marked)].count("\n") + 1
            marks = editor.open(path)
            assert [mark.line for mark in marks] == [line], (wrong, marks)
            assert said in marks[0].message, (wrong, marks)
            assert line in {each["line"] for each in told(path, capsys)}, wrong
        # Whatever it marks in a protocol drawn at random, a check refuses in the same line.
        seen = 0
        for number, each in enumerate(drawn(registry, 20, seed=3)):
            path = folder / f"drawn{number}.yaml"
            path.write_bytes(MODELINE.encode() + each.text)
            marks, found = editor.open(path), told(path, capsys)
            refused = [one for one in found if one["kind"] == "problem"]
            assert refused or not marks, (str(each), marks)
            seen += bool(marks)
            if marks and each.fault != "removed":
                lines = {one["line"] for one in refused}
                assert lines & {mark.line for mark in marks}, (str(each), marks, refused)
        assert seen > 10


@pytest.mark.long
@needs("yaml-language-server")
def test_the_yaml_language_server_shows_units_and_offers_what_is_installed(
    folder: Path, registry: Registry, yaml_server: Sequence[str]
) -> None:
    text = MODELINE + AIMING
    path = folder / "protocol.yaml"
    path.write_text(text, encoding="utf-8")
    with Editor(yaml_server, folder) as editor:
        assert editor.open(path) == []
        for word, shown in {
            "rate_h": ("Ticks of the loop per second. Plain numbers are in Hz", "1 kHz"),
            "movements: 4, end: rest_inside, limit": ("in seconds; then it ends as a", "200 ms"),
            "6], wid": ("Diameter of a circle, in metres. Plain numbers are in m", "50 cm"),
            "at: target, fa": ("Distance between tip and target, in metres", "50 cm"),
        }.items():
            hover = editor.hover(path, *place(text, word))
            assert all(each in hover for each in shown), (word, hover)
        one, several = roles_by_key(several=False), roles_by_key(several=True)
        for key, before in {
            "input": "input: {use: ",
            "dynamics": "dynamics: {use: ",
            "tasks": "aiming: {use: ",
            "feedback": "ball: {use: ",
            "views": "operator: {use: ",
        }.items():
            roles = (one | several)[key]
            installed = {name for role in roles for name in registry.offers[role]}
            assert set(editor.complete(path, *place(text, before))) == installed, key
        assert "ch8" in editor.complete(path, *place(text, "machine: "))


@pytest.fixture
def own_server() -> Sequence[str]:
    return [sys.executable, "-m", "labcrane", "language-server"]


@pytest.mark.slow
@needs("mujoco")
def test_labcranes_language_server_marks_what_a_check_finds(
    folder: Path, registry: Registry, own_server: Sequence[str], capsys: pytest.CaptureFixture[str]
) -> None:
    path, other = folder / "protocol.yaml", folder / "notes.yaml"
    other.write_text("- no protocol\n")
    with Editor(own_server, folder) as editor:
        assert editor.open(path) == []
        for each in drawn(registry, 6, seed=4):
            path.write_bytes(each.text)
            marks, found = editor.save(path), told(path, capsys)
            assert [(mark.line, mark.column, mark.message) for mark in marks] == [
                (one["line"], one["column"], one["message"]) for one in found
            ], str(each)
            assert [mark.severity for mark in marks] == [
                {"problem": 1, "question": 2}[one["kind"]] for one in found
            ]
        path.write_text(AIMING, encoding="utf-8")
        assert editor.save(path) == []


@pytest.mark.slow
@needs("mujoco")
def test_mistakes_in_another_file_are_marked_where_the_protocol_names_it(
    tmp_path: Path, own_server: Sequence[str], capsys: pytest.CaptureFixture[str]
) -> None:
    path, machine = tmp_path / "protocol.yaml", tmp_path / "digger.yaml"
    shutil.copy(PROTOCOLS / "aiming" / "instructions.md", tmp_path)
    path.write_text(AIMING.replace("machine: ch8", "machine: digger.yaml"), encoding="utf-8")
    machine.write_text("titel: Digger\njoints: 5\n")
    with Editor(own_server, tmp_path) as editor:
        marks = editor.open(path)
        assert {mark.line for mark in marks} == {place(AIMING, "machine:")[0]}
        assert [mark.message for mark in marks] == [each["message"] for each in told(path, capsys)]
        for spot in ("1:1", "2:9"):
            assert any(f"digger.yaml:{spot}: " in mark.message for mark in marks)
        path.write_text(AIMING, encoding="utf-8")
        assert editor.save(path) == []


@needs("mujoco")
def test_the_supervisors_page_asks_what_a_check_asks(
    folder: Path, registry: Registry, capsys: pytest.CaptureFixture[str]
) -> None:
    from labcrane.web.control_room.snapshot import asked as shown

    path, asked = folder / "protocol.yaml", 0
    doubtful = [each for each in faults("aiming", AIMING, 5) if "written as 1e300" in each.fault]
    for each in doubtful:
        path.write_bytes(each.text)
        found = told(path, capsys)
        if any(one["kind"] == "problem" for one in found):
            continue
        asked += len(found)
        assert [line["text"] for line in shown(load(path, registry))] == [
            f"line {one['line']} of protocol.yaml: {one['message']}" for one in found
        ]
    assert asked >= 2
