"""Files that a study names: scenes, machines, models, questionnaires; none may change unseen."""

import json
import shutil
import sys
from pathlib import Path

import pytest
from governed import Lab, edit
from needs import need
from programs import ran

from labcrane import ProtocolError
from labcrane.approval.lock import lock_path
from labcrane.approval.materials import referred
from labcrane.participants.folders import Places
from labcrane.session.eligibility import check_eligibility

RESCUE = Path(__file__).parents[2] / "protocols" / "retrieval"
ASKED = """
questionnaires:
  ssq: {use: ssq, file: forms/ssq.yaml}
  comfort: {use: free, file: forms/comfort.yaml}
stop_rules: [{questionnaire: ssq, score: total, above: 60}]
"""
COMFORT = "title: Comfort\nquestions:\n  - {name: heat, text: Too hot?}\n"


@pytest.fixture
def rescue(tmp_path: Path) -> Lab:
    need("pybullet")
    """Return the bundled rescue study with questionnaires of the lab's, approved."""
    folder = tmp_path / "rescue"
    shutil.copytree(RESCUE, folder, ignore=shutil.ignore_patterns("hydraulic_arm", "data"))
    text = (folder / "protocol.yaml").read_text(encoding="utf-8")
    text = text.replace("    steps:\n", "    steps:\n      - questionnaire: [comfort, ssq]\n")
    (folder / "forms").mkdir()
    words = json.dumps([f"symptom {number}" for number in range(1, 17)])
    (folder / "forms" / "ssq.yaml").write_text(
        f"rights: bought\nitems: {words}\n", encoding="utf-8"
    )
    (folder / "forms" / "comfort.yaml").write_text(COMFORT, encoding="utf-8")
    lab = Lab(folder, text + ASKED)
    lab.approve()
    lab.consent("R001")
    return lab


DRIFTS = {
    "scenes/touch.yaml": ("radius: 0.08, jaws", "radius: 0.09, jaws"),  # where the targets are
    "ied_arm.yaml": ("a: 1.1, offset", "a: 1.15, offset"),
    "arm.dmd.yaml": ("dead_time_s: 0.086", "dead_time_s: 0.087"),
    "forms/ssq.yaml": ("symptom 8", "another symptom"),
    "forms/comfort.yaml": ("Too hot?", "Too cold?"),
}


@pytest.mark.slow
def test_labcrane_run_refuses_another_number_or_question_in_any_file_and_names_it(
    rescue: Lab,
) -> None:
    """With the command itself, in another working folder than the one it was approved from."""
    for name, (old, new) in DRIFTS.items():
        edit(rescue.folder / name, old, new)
    done = ran(
        [sys.executable, "-m", "labcrane", "run", "study.yaml", "--participant", "R001"],
        cwd=rescue.folder,
    )
    assert done.returncode == 2
    for said in (
        "  file scenes/touch.yaml: goals[1].radius was 0.08, is 0.09",
        "  file forms/ssq.yaml: items[8] was 'symptom 8', is 'another symptom'",
        "  file forms/comfort.yaml: questions[1].text was 'Too hot?', is 'Too cold?'",
    ):
        assert said in done.stderr.splitlines()
    named = [line.split(":")[0] for line in done.stderr.splitlines() if line.startswith("  ")]
    assert set(named) == {*(f"  file {name}" for name in DRIFTS), "  the machine"}
    assert not (rescue.places.root / "R001").exists()


@pytest.mark.slow
def test_each_of_these_files_alone_is_refused(rescue: Lab) -> None:
    for name, (old, new) in DRIFTS.items():
        check_eligibility(rescue.visit("R001"))
        edit(rescue.folder / name, old, new)
        with pytest.raises(ProtocolError, match=f"\n  file {name}: "):
            check_eligibility(rescue.visit("R001"))
        edit(rescue.folder / name, new, old)


@pytest.mark.slow
def test_the_lock_holds_wherever_the_files_are_moved(rescue: Lab) -> None:
    elsewhere = rescue.folder.with_name("another disk")
    rescue.folder.rename(elsewhere)
    rescue.folder, rescue.protocol = elsewhere, elsewhere / "study.yaml"
    rescue.places = Places(elsewhere / "data")
    check_eligibility(rescue.visit("R001"))


def test_a_file_that_would_not_move_with_the_study_is_not_approved(rescue: Lab) -> None:
    lock_path(rescue.protocol).unlink()
    (rescue.folder / "forms" / "ssq.yaml").rename(rescue.folder.parent / "ssq.yaml")
    edit(rescue.protocol, "forms/ssq.yaml", "../ssq.yaml")
    with pytest.raises(
        ProtocolError, match=r"questionnaires\.ssq\.file: .*ssq\.yaml is not in the folder of"
    ):
        rescue.approve()


URDF = """\
<robot name="arm"><link name="base"><visual><geometry>
<mesh filename="package://arm_description/meshes/base.stl"/></geometry></visual></link></robot>
"""


def test_the_meshes_that_a_robots_file_names_are_part_of_the_study(tmp_path: Path) -> None:
    """Else the lock would not see them change, and a bundle would leave them at home."""
    files = {
        "robots/arm.urdf": URDF,
        "meshes/base.stl": "solid",
        "meshes/of_another.stl": "solid",
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text, encoding="utf-8")
    found = {
        path.relative_to(tmp_path).as_posix()
        for path in referred({"machine": {"urdf": "robots/arm.urdf"}}, tmp_path)
    }
    assert found == {"robots/arm.urdf", "meshes/base.stl"}
