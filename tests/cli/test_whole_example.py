"""The example of a whole study: checked, planned with every step, and run."""

import shutil
from pathlib import Path

import pytest
from ruamel.yaml import YAML

from labcrane import open_recording
from labcrane.testing import main

WHOLE = Path(__file__).parents[2] / "protocols" / "whole"
STEPS = (
    "  instructions: Move the tip",
    "  questionnaire: about",
    "  block 1 aiming (practice): 4 trials",
    "  block 2 aiming: 16 trials",
    "  questionnaire: effort",
    "  break of 120 s",
    "  block 3 aiming: 16 trials",
    "  questionnaire: effort, accuracy",
)


@pytest.fixture
def protocol(tmp_path: Path) -> Path:
    return Path(shutil.copytree(WHOLE, tmp_path / "whole")) / "protocol.yaml"


def test_the_plan_lists_every_step_of_a_session_in_order(
    protocol: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["plan", str(protocol), "--participant", "P001"]) == 0
    said = capsys.readouterr().out
    places = [said.index(step) for step in STEPS]
    assert places == sorted(places)


def test_the_variant_for_the_keyboard_is_the_study_but_for_the_controls(
    protocol: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["check", str(protocol.with_name("keyboard.yaml"))]) == 0
    assert "warning" not in capsys.readouterr().out
    study, variant = (
        YAML(typ="safe").load(protocol.with_name(name))
        for name in ("protocol.yaml", "keyboard.yaml")
    )
    assert variant["views"]["operator"].pop("keys")
    differ = {key for key in {*study, *variant} if study.get(key) != variant.get(key)}
    assert differ == {"study", "title", "input", "operator", "scheme"}
    keyboard, sticks = variant["scheme"], study["scheme"]
    assert set(keyboard["map"]) == set(sticks["map"])


@pytest.mark.slow
def test_a_session_of_it_runs_and_its_trials_are_those_that_are_counted(
    protocol: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["run", str(protocol), "--participant", "P002", "--simulate", "--fast"]
    assert main(words) == 0
    assert "32/32" in capsys.readouterr().out, "practice is not counted"
    folder = protocol.parent / "data" / "P002-SIMULATED"
    session = open_recording(folder / "P002-SIMULATED.h5").session(1)
    assert session.context["group"] == "with_sphere"
    assert session.events["name"].tolist()[-1] == "session.end"


def test_a_session_that_was_run_is_refused_before_anything_is_shown(
    protocol: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (protocol.parent / "data" / "P001-PILOT").mkdir(parents=True)
    (protocol.parent / "data" / "P001-PILOT" / "ses-01_run.xdf").write_bytes(b"XDF:")
    assert main(["run", str(protocol), "--participant", "P001", "--pilot", "--local"]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert "P001-PILOT has an unfinished session 1" in said.err
    assert "its process died; to continue, run: labcrane resume" in said.err
    assert "--participant P001 --session 1 --pilot" in " ".join(said.err.split())
