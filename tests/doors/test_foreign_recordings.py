"""Recordings of strangers: nothing in them is run, and nothing is written where they say."""

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import pytest
from rehearsal import simulated_file
from results.recorded import STUDY, record, study

from labcrane import RecordingError, open_recording
from labcrane.feedback import playback
from labcrane.processes.handle import ProcessHandle
from labcrane.replay.restore import restore
from labcrane.testing import main

EVIL = "from pathlib import Path\nPath({mark!r}).write_text('ran')\nraise ImportError('evil')\n"

TELLS = STUDY.replace("    steps:\n", "    steps:\n      - instructions: texts/instructions.md\n")

CUE = """
from labcrane import Cue, Settings, hookimpl, offer


class Own(Cue):
    def draw(self, frame):
        return []


@hookimpl
def labcrane_cues():
    return [offer("own_cue", Settings, lambda settings, machine: Own())]
"""


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("told")
    (root / "texts").mkdir()
    (root / "texts" / "instructions.md").write_text("Move.", encoding="utf-8")
    return record(study(root, TELLS), root / "data", "P001", simulated=True)


def altered(path: Path, folder: Path, change: Callable[[dict[str, Any]], None]) -> Path:
    """Return a copy of a recording whose protocol and context were written by somebody else."""
    copy = folder / "P001.h5"
    copy.write_bytes(path.read_bytes()[:-32])
    with h5py.File(copy, "r+") as file:
        group = file["ses-01"]
        context = json.loads(group["context"][()])
        content = {"protocol": group["protocol"][()].decode(), "context": context}
        change(content)
        for name, text in (
            ("protocol", content["protocol"]),
            ("context", json.dumps(content["context"])),
        ):
            attrs = dict(group[name].attrs)
            del group[name]
            group[name] = text
            group[name].attrs.update(attrs)
    return copy


def shown_only(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Have nothing opened by ``--show``; return where the studies that are shown are read."""
    seen: list[str] = []
    monkeypatch.setattr(playback, "play", lambda study, *rest, **more: seen.append(str(study.path)))
    return seen


def with_code(content: dict[str, Any], code: str) -> None:
    names = ("plugins/evil.py", "plugins/../plugins/evil.py", "x/../plugins/EVIL.PY")
    content["context"]["files"] = {name: {"sha256": "", "text": code} for name in names}
    content["context"]["own_plugins"] = {"plugins/evil.py": code}


@pytest.mark.slow
@pytest.mark.parametrize("words", [[], ["--show"], ["--speed", "50"]], ids=" ".join)
def test_code_in_a_recording_is_not_run(
    told: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: list[str]
) -> None:
    seen, mark = shown_only(monkeypatch), tmp_path / "mark"
    code = EVIL.format(mark=str(mark))
    path = altered(told, tmp_path, lambda content: with_code(content, code))
    assert main(["replay", str(path), *words]) == 0
    assert bool(seen) == ("--show" in words)
    assert not mark.exists()


@pytest.mark.parametrize("kind", ["absolute", "above", "deep"])
def test_instructions_are_written_nowhere_else(told: Path, tmp_path: Path, kind: str) -> None:
    target = tmp_path / "home" / ".profile"
    name = {
        "absolute": str(target),
        "above": os.path.relpath(target, tmp_path / "study"),
        "deep": "texts/../../home/.profile",
    }[kind]

    def change(content: dict[str, Any]) -> None:
        content["protocol"] = content["protocol"].replace("texts/instructions.md", name)

    path = altered(told, tmp_path, change)
    (tmp_path / "study").mkdir()
    written = restore(open_recording(path).session(1), tmp_path / "study", None, None)
    assert not target.exists()
    assert written.parent == tmp_path / "study"
    assert (tmp_path / "study" / "instructions-1.txt").read_text() == "Move."
    assert main(["replay", str(path)]) == 0
    assert not target.exists()


@pytest.fixture(scope="module")
def own(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A session of a study with a cue of its own, whose folder is gone."""
    root = tmp_path_factory.mktemp("own")
    (root / "plugins").mkdir()
    (root / "plugins" / "own.py").write_text(CUE, encoding="utf-8")
    return simulated_file(root, STUDY.replace("tasks:", "feedback: {own: {use: own_cue}}\ntasks:"))


def test_the_code_of_a_study_is_run_when_somebody_says_so(
    own: Path, tmp_path: Path, capsys, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = shown_only(monkeypatch)
    for words in ([], ["--show"]):
        assert main(["replay", str(own), *words]) == 2
        said = " ".join(capsys.readouterr().err.split())
        assert "'own_cue' is not installed" in said
        assert "the study had plugins of its own, plugins/own.py, whose code is in the" in said
        assert "recording and is not run" in said
        assert "if you trust the author of the file, use --run-recorded-code" in said
    assert main(["replay", str(own), "--run-recorded-code"]) == 0
    assert "every number the same bit for bit" in capsys.readouterr().out
    assert main(["replay", str(own), "--show", "--run-recorded-code"]) == 0
    assert len(seen) == 1


@pytest.mark.parametrize(
    "name",
    ["../evil.py", "/tmp/evil.py", "plugins/../../evil.py", "plugins/.py", "plugins/a\\b.py"],
)
def test_recorded_code_is_written_beside_the_restored_study_only(
    own: Path, tmp_path: Path, name: str
) -> None:
    def change(content: dict[str, Any]) -> None:
        content["context"]["own_plugins"] = {name: CUE}

    record = open_recording(altered(own, tmp_path, change)).session(1)
    (tmp_path / "study").mkdir()
    with pytest.raises(RecordingError, match="which no plugin of a study is: they are files in"):
        restore(record, tmp_path / "study", None, None, run_code=True)
    assert not list(tmp_path.glob("**/*evil.py"))


SHAPES = {
    "a list": "[1, 2]",
    "a word": "word",
    "no sessions": "machine: ch8",
    "sessions that are none": "sessions: 3",
    "steps that are none": "sessions: [{steps: 3}]",
    "questionnaires that are none": "questionnaires: [3]\nsessions: []",
}


@pytest.mark.parametrize("text", SHAPES.values(), ids=SHAPES)
def test_a_protocol_of_another_shape_is_refused_in_words(
    told: Path, tmp_path: Path, capsys, text: str
) -> None:
    path = altered(told, tmp_path, lambda content: content.update(protocol=text))
    assert main(["replay", str(path)]) == 1
    said = capsys.readouterr().err
    assert "Traceback" not in said
    assert "protocol" in said


def test_processes_take_no_module_from_the_folder_somebody_stands_in(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mark = tmp_path / "mark"
    for name in ("json", "labcrane", "numpy", "runpy"):
        (tmp_path / f"{name}.py").write_text(EVIL.format(mark=str(mark)), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    child = ProcessHandle("labcrane.doctor.check_process", "look")
    child.start()
    child.stop()
    assert not mark.exists()
