"""A new plugin of every role installs, passes its tests, is listed, and does its part in a run."""

import json
import sys
from pathlib import Path

import pytest
from fresh_environment import environment_with, run

from labcrane import open_recording
from labcrane.registry.hookspecs import ROLES
from labcrane.registry.scaffold import TEMPLATES, kinds
from labcrane.testing import main

NAMES = {role: "mycounter" if role == "command" else f"my_{role}" for role in kinds()}


@pytest.fixture(scope="module")
def projects(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    into = tmp_path_factory.mktemp("projects")
    for role, name in NAMES.items():
        assert main(["new-plugin", role, name, "--into", str(into)]) == 0
    return {role: into / f"labcrane-{name.replace('_', '-')}" for role, name in NAMES.items()}


@pytest.fixture(scope="module")
def environment(projects: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    return environment_with(projects.values(), tmp_path_factory.mktemp("environment"))


def test_there_is_a_template_for_every_role() -> None:
    assert {path.name for path in TEMPLATES.iterdir()} - {"any"} == set(kinds())
    assert {entry.word for entry in ROLES.values()} | {"command"} == set(kinds())


@pytest.mark.parametrize("role", kinds())
def test_nothing_is_left_to_fill_in(role: str, projects: dict[str, Path]) -> None:
    for path in projects[role].iterdir():
        text = path.read_text(encoding="utf-8")
        for placeholder in ("my_part", "MyPart", "my_module", "my-project", "a_role"):
            assert placeholder not in text + path.name, path
    checked = run(
        sys.executable, "-m", "ruff", "check", "--isolated", "--line-length=100", projects[role]
    )
    assert checked.returncode == 0, checked.stdout
    tidy = ["ruff", "format", "--isolated", "--line-length=100", "--check"]
    checked = run(sys.executable, "-m", *tidy, projects[role])
    assert checked.returncode == 0, checked.stdout


def test_what_the_readme_runs_does_start_the_plugin(projects: dict[str, Path]) -> None:
    texts = {role: (projects[role] / "README.md").read_text(encoding="utf-8") for role in NAMES}
    presented = {role for role, text in texts.items() if "--simulate --feedback" in text}
    assert presented == {"cue", "feedback"}
    lines = (projects["cue"] / "protocol.yaml").read_text(encoding="utf-8").splitlines()
    assert "  window: {use: view}" in lines  # nothing else draws a cue
    lines = (projects["input"] / "protocol.yaml").read_text(encoding="utf-8").splitlines()
    assert "input: {use: my_input}" in lines
    assert any(line.startswith("operator: {use: my_input}  # with --simulate") for line in lines)


@pytest.mark.long
def test_all_are_listed_where_they_are_installed(environment: Path, tmp_path: Path) -> None:
    done = run(environment, "-m", "labcrane", "plugins", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    listed = json.loads(done.stdout)
    assert listed["broken"] == {}
    assert set(NAMES.values()) - {"mycounter"} <= {each["name"] for each in listed["offers"]}
    helped = run(environment, "-m", "labcrane", "mycounter", "count", "--help", cwd=tmp_path)
    assert "Count the trials of every participant" in helped.stdout


@pytest.mark.long
@pytest.mark.parametrize("role", kinds())
def test_its_tests_pass(role: str, environment: Path, projects: dict[str, Path]) -> None:
    done = run(environment, "-m", "pytest", "-q", "-p", "no:cacheprovider", cwd=projects[role])
    assert done.returncode == 0, done.stdout
    assert " passed" in done.stdout


@pytest.mark.long
@pytest.mark.parametrize("role", kinds())
def test_it_does_its_part_in_a_run(
    role: str, environment: Path, projects: dict[str, Path], tmp_path: Path
) -> None:
    name, protocol = NAMES[role], projects[role] / "protocol.yaml"
    how = "--feedback" if role == "feedback" else "--fast"
    if role == "feedback":  # which takes real time
        protocol.write_text(
            protocol.read_text(encoding="utf-8").replace("{task: work}", "{task: work, pairs: 1}"),
            encoding="utf-8",
        )
    arguments = ["--participant", "P001", "--simulate", how, "--data", tmp_path / "data"]
    done = run(environment, "-m", "labcrane", "run", protocol, *arguments)
    assert done.returncode == 0, done.stdout + done.stderr
    session = open_recording(next(tmp_path.glob("data/*/*.h5"))).session(1)
    assert len(session.trials) >= 1
    used = {each["use"] for each in session.context["components"].values()}
    match role:
        case "exporter":
            out = tmp_path / "out"
            to = ["--to", name, "--include", "simulated", "--out", out]
            done = run(environment, "-m", "labcrane", "export", tmp_path / "data", *to)
            assert done.returncode == 0, done.stderr
            assert (out / "P001-SIMULATED_ses-01.csv").read_text(encoding="utf-8").count(
                "\n"
            ) == 1 + len(session.trials)
        case "command":
            done = run(environment, "-m", "labcrane", name, "count", tmp_path / "data")
            assert done.stdout == f"P001-SIMULATED: {len(session.trials)}\n"
        case "feedback":
            shown = session.streams[f"labcrane.feedback.{name}"].data
            assert shown["brightness"].max() > 0.0
        case "task":
            assert set(session.trials["outcome"]) == {"success"}
            assert used >= {name}
        case _:
            assert name in used


def test_names_that_cannot_be_used_are_refused_in_words(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    refusals = {
        ("cuee", "my_arrow"): "there is no role 'cuee'; did you mean 'cue'?",
        ("gizmo", "my_arrow"): "there is no role 'gizmo'; there is input, scheme, dynamics",
        ("cue", "My-Arrow"): "'My-Arrow' cannot name a plugin; give a lower-case word of letters",
        ("cue", "lambda"): "'lambda' cannot name a plugin",
        ("cue", "sphere"): "plugin 'sphere' offers 'sphere' already; choose another name",
        ("task", "sphere"): "plugin 'sphere' offers 'sphere' already",
        ("command", "my_count"): "'my_count' cannot name a command; give one word of letters",
        ("command", "dmd"): "there are commands 'dmd' already; choose another name",
    }
    for (role, name), words in refusals.items():
        assert main(["new-plugin", role, name, "--into", str(tmp_path)]) == 1
        assert words in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_nothing_is_overwritten(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["new-plugin", "scheme", "my_scheme", "--into", str(tmp_path)]
    assert main(arguments) == 0
    assert main(arguments) == 1
    said = capsys.readouterr().err
    assert "labcrane-my-scheme exists already, and nothing is overwritten" in said
