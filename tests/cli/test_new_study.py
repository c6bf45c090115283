"""Studies that come with labcrane, copied for a laboratory to change."""

from pathlib import Path

import pytest
from needs import need

from labcrane.cli.shipped import shipped_studies
from labcrane.testing import main

ROOT = Path(__file__).parents[2]
SHIPPED = ("aiming", "crane_pilot", "crossover", "pre_post", "retrieval", "washout", "whole")
ENGINE = {"aiming": "mujoco", "crane_pilot": "mujoco", "retrieval": "pybullet"}


def test_the_studies_that_come_with_it_are_those_that_its_help_names(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert tuple(shipped_studies()) == SHIPPED
    assert main(["new-study", "--help"]) == 0
    said = " ".join(capsys.readouterr().out.replace("│", " ").split())
    assert f"{', '.join(SHIPPED[:-1])} or {SHIPPED[-1]}" in said


@pytest.mark.parametrize("name", SHIPPED)
def test_a_copy_is_a_study_of_its_own_name_that_check_finds_fine(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    need(*([ENGINE[name]] if name in ENGINE else []))
    folder = tmp_path / "my_study"
    assert main(["new-study", name, str(folder)]) == 0
    said = capsys.readouterr().out
    assert said.splitlines()[0] == f"study: {folder / 'protocol.yaml'}"
    assert main(["check", str(folder)]) == 0
    assert "study 'my_study' is fine" in capsys.readouterr().out
    shipped = shipped_studies()[name]
    copied = {path.relative_to(folder) for path in folder.rglob("*")}
    assert copied == {path.relative_to(shipped) for path in shipped.rglob("*")}
    for each in shipped.glob("*.yaml"):
        before = each.read_text(encoding="utf-8").splitlines()
        after = (folder / each.name).read_text(encoding="utf-8").splitlines()
        changed = [(one, other) for one, other in zip(before, after, strict=True) if one != other]
        assert changed == [
            (line, line.replace(f"study: {name}", "study: my_study"))
            for line in before
            if line.startswith("study: ")
        ]


def test_recordings_and_an_approval_of_the_study_stay_where_they_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ran = tmp_path / "shipped" / "aiming"
    (ran / "data" / "P001").mkdir(parents=True)
    for name in ("protocol.yaml", "protocol.lock.json", "protocol.lock.1.json", "consent.pdf"):
        (ran / name).write_text("study: aiming\n", encoding="utf-8")
    monkeypatch.setattr("labcrane.cli.shipped.shipped_studies", lambda: {"aiming": ran})
    assert main(["new-study", "aiming", str(tmp_path / "mine")]) == 0
    copied = {path.name for path in (tmp_path / "mine").rglob("*")}
    assert copied == {"protocol.yaml", "consent.pdf"}


def test_what_cannot_be_copied_is_refused_and_nothing_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    full = tmp_path / "mine"
    full.mkdir()
    for name, folder, why in (
        (
            "aming",
            tmp_path / "study",
            "no study 'aming' comes with labcrane; did you mean 'aiming'?",
        ),
        (
            "aiming",
            tmp_path / "My Study",
            "'My Study' cannot name a study; give a folder whose name",
        ),
        ("aiming", full, f"{full} exists already; nothing was copied; choose another folder"),
        ("aiming", tmp_path / ("s" * 300), "could not be made: "),
    ):
        assert main(["new-study", name, str(folder)]) == 2
        assert why in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == [full]
    assert not list(full.iterdir())
