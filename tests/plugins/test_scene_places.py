"""Places of things are found at the desk, not when somebody sits in the trial that has them."""

from pathlib import Path

import numpy as np
import pytest
from cranes import needs_bullet
from dmd_arms import with_files

from labcrane.files.pseudonyms import pseudonyms
from labcrane.machines import load_scene, place_objects
from labcrane.testing import discover, load, main, plan_session

pytestmark = [pytest.mark.slow, needs_bullet]

SCENE = """\
labcrane_scene: 1
title: Two parcels
things:
  one: {use: parts/parcel.yaml, position: [2.0, 0.2, 0.001]}
  two: {use: parts/parcel.yaml, position: [2.0, 0.7, 0.001], scatter: {y: [-0.3, 0.1]}}
goals: [{position: [0, 0, 0.5], beside: one, radius: 0.5}]
limit_s: 2
"""
PARCEL_M = 0.25
STUDY = """\
labcrane: 1
study: places
title: Two parcels
participants: {pattern: 'P\\d{3}', planned: 30}
machine: ied_arm.yaml
input: {use: gateway}
operator: {use: scenario_operator}
scheme: {use: valve}
dynamics:
  use: dmd_arm
  model: arm.dmd.yaml
  proportional: [base]
  scenes: &scenes [scenes/touch.yaml, scenes/own.yaml]
tasks: {reach: {use: scenario, scenes: *scenes, limit_s: 1}}
sessions: [{name: only, steps: [{block: {task: reach}}, {block: {task: reach, name: again}}]}]
"""


@pytest.fixture
def study(tmp_path: Path) -> Path:
    with_files(tmp_path)
    (tmp_path / "scenes" / "own.yaml").write_text(SCENE, encoding="utf-8")
    (tmp_path / "study.yaml").write_text(STUDY, encoding="utf-8")
    return tmp_path / "study.yaml"


def first_overlaps(path: Path) -> dict[str, tuple[str, int]]:
    """Return of each block the first participant and trial in which the parcels overlap."""
    study, scene = load(path, discover()), load_scene(path.parent / "scenes" / "own.yaml")
    found: dict[str, tuple[str, int]] = {}
    for slot, name in enumerate(pseudonyms(r"P\d{3}", 30), start=1):
        for block in plan_session(study, name, 1, slot).blocks:
            for trial in block.trials:
                if trial.planned.condition["scenario"] != "own":
                    continue
                one, two = (np.array(each.position) for each in place_objects(scene, trial.seed))
                if abs(two[1] - one[1]) < PARCEL_M:
                    found.setdefault(block.name, (name, trial.number))
    return found


def test_a_rehearsal_names_the_first_participant_whose_things_stand_in_each_other(
    study: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    expected = first_overlaps(study)
    assert set(expected) == {"reach", "again"}
    assert main(["check", str(study)]) == 0
    capsys.readouterr()
    assert main(["check", str(study), "--rehearse"]) == 2
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 2, said
    for line, (name, trial) in zip(said, expected.values(), strict=True):
        assert (
            f"rehearsal, session 'only', trial {trial} of {name}: 'two' overlaps 'one' by 0."
            in line
        )
        assert line.endswith("move it, or scatter it less")


def test_a_start_that_the_machine_cannot_take_is_named_whichever_scene_has_it(
    study: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    own = study.parent / "scenes" / "own.yaml"
    own.write_text(SCENE.replace("0.7, 0.001], scatter", "0.9, 0.001], scatter"), encoding="utf-8")
    assert main(["check", str(study), "--rehearse"]) == 0, capsys.readouterr().err
    own.write_text(own.read_text() + "start_deg: [0, 0, 0, 4000]\n", encoding="utf-8")
    capsys.readouterr()
    assert main(["check", str(study), "--rehearse"]) == 2
    assert "a pose with " in capsys.readouterr().err


def test_a_scene_without_a_start_begins_with_the_machine_at_rest(study: Path) -> None:
    loaded = load(study, discover())
    plan = plan_session(loaded, "P001", 1, 1)
    starts = {
        str(trial.planned.condition["scenario"]): trial.planned.start_pose
        for block in plan.blocks
        for trial in block.trials
    }
    assert starts["own"] == loaded.machine.rest
    np.testing.assert_allclose(np.degrees(starts["touch"]), [0, 0, 0, 40])
