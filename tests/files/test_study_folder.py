"""A study is found by its folder, its protocol or its data, whatever its files are called."""

from pathlib import Path
from random import Random

import pytest

from labcrane import ProtocolError, RecordingError
from labcrane.files.study_folder import data_of, protocol_of

PROTOCOL = "# A study\nlabcrane: 1\nstudy: s\n"


def a_study(folder: Path, protocol: str) -> Path:
    folder.mkdir()
    (folder / protocol).write_text(PROTOCOL, encoding="utf-8")
    (folder / "people.yaml").write_text("labcrane_cohort: 1\n", encoding="utf-8")
    (folder / "machine.yaml").write_text("title: labcrane: an arm\n", encoding="utf-8")
    return folder


@pytest.mark.parametrize("seed", range(30))
def test_every_way_to_name_a_study_leads_to_the_same_data(tmp_path: Path, seed: int) -> None:
    random = Random(seed)
    name = random.choice(["protocol.yaml", "protocol.yml", "study.yaml", "Ä b.yaml"])
    folder = a_study(tmp_path / "a study", name)
    data = folder / "data"
    there = random.randint(0, 3)
    if there:
        data.mkdir()
    if there == 2:
        (data / "register").mkdir()
    if there == 3:
        (data / "P001").mkdir()
        (data / "P001" / "P001.h5").touch()
    if random.random() < 0.5:
        (folder / "register").mkdir()  # of a command that was run in the wrong folder
    ways = [folder, folder / name, *([data] * bool(there))]
    assert {data_of(each) for each in ways} == {data}
    assert {protocol_of(each) for each in ways} == {folder / name}


@pytest.mark.parametrize("holds", ["register/register.json", "P001/P001.h5", "P1/ses-01_run.xdf"])
def test_data_elsewhere_are_data(tmp_path: Path, holds: str) -> None:
    path = tmp_path / "kept" / holds
    path.parent.mkdir(parents=True)
    path.touch()
    assert data_of(tmp_path / "kept") == tmp_path / "kept"
    if "register" not in holds:  # a participant's folder, which recover takes
        assert data_of(path.parent) == path.parent


def test_a_folder_of_something_else_is_refused(tmp_path: Path) -> None:
    (tmp_path / "notes.yaml").write_text("title: notes\n", encoding="utf-8")
    with pytest.raises(RecordingError, match=r"is not the folder of a study: it has no protocol"):
        data_of(tmp_path)
    with pytest.raises(RecordingError, match=r"there is no folder .*gone; give the study's folder"):
        data_of(tmp_path / "gone")
    with pytest.raises(ProtocolError, match=r"there is no protocol\.yaml in .*, nor another"):
        protocol_of(tmp_path)


def test_of_several_protocols_the_usual_one_is_taken_or_one_is_asked_for(tmp_path: Path) -> None:
    folder = a_study(tmp_path / "s", "keyboard.yaml")
    (folder / "panel.yaml").write_text(PROTOCOL, encoding="utf-8")
    with pytest.raises(ProtocolError, match=r"several protocols, keyboard\.yaml, panel\.yaml"):
        protocol_of(folder)
    assert data_of(folder) == folder / "data"
    (folder / "protocol.yaml").write_text(PROTOCOL, encoding="utf-8")
    assert protocol_of(folder) == folder / "protocol.yaml"
