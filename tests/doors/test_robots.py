"""Robots' descriptions of strangers: bombs and ways out of the study, refused in words at once."""

import time
from pathlib import Path

import pytest
from needs import needs

from labcrane.machines.descriptions.chain import ChainError
from labcrane.machines.descriptions.mjcf_file import MjcfFile
from labcrane.machines.descriptions.urdf_file import UrdfFile

LOL = "".join(f'<!ENTITY l{at} "{f"&l{at - 1};" * 10}">' for at in range(1, 12))
LINKS = "".join(f'<link name="l{at}"/>' for at in range(600))
MANY = '<replicate count="1000">' * 4 + '<geom size="1"/>' + "</replicate>" * 4


def urdf(inside: str, before: str = "") -> str:
    return f'{before}<robot name="r">{inside}</robot>'


def mjcf(inside: str) -> str:
    return f"<mujoco>{inside}</mujoco>"


URDF = {
    "entities": (urdf("&l11;", f'<!DOCTYPE r [<!ENTITY l0 "lol">{LOL}]>'), "has a document type"),
    "a file in an entity": (
        urdf("&x;", '<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/hostname">]>'),
        "has a document type",
    ),
    "deep": (urdf("<a>" * 50_000 + "</a>" * 50_000), "nested deeper than 100 elements"),
    "wide": (urdf("<link/>" * 30_000), "has more than 20000"),
    "links": (urdf(LINKS), "it has 600 links; the maximum is 500"),
    "large": (urdf(" " * 5_100_000), "robot.xml has 51000"),
    "no XML": ("robot", "it cannot be read: syntax error"),
    "two bytes a letter": (urdf("").encode("utf-16").decode("latin-1"), "is not UTF-8"),
}

MJCF = {
    "repeated": (mjcf(f"<worldbody>{MANY}</worldbody>"), "more than 20000 elements, with what"),
    "a grid": (mjcf('<flexcomp count="300 300 300"/>'), "more than 20000 elements, with what it"),
    "heights": (mjcf('<asset><hfield nrow="90000" ncol="90000"/></asset>'), "asks for 8.1e+09 val"),
    "colours": (mjcf('<asset><texture width="90000" height="90000"/></asset>'), "by width and hei"),
    "itself": (mjcf('<include file="robot.xml"/>'), "it includes robot.xml twice, or itself"),
    "a file elsewhere": (mjcf('<include file="../secret.xml"/>'), "is not in the folder of the"),
    "an absolute mesh": (mjcf('<asset><mesh file="/etc/hostname"/></asset>'), "is not in the fold"),
    "a mesh by meshdir": (
        mjcf('<compiler meshdir="../.."/><asset><mesh file="a.stl"/></asset>'),
        "it names 'a.stl', and",
    ),
    "a texture's side": (mjcf('<asset><texture fileup="/a.png"/></asset>'), "it names '/a.png'"),
    "entities": (f'<!DOCTYPE r [<!ENTITY l0 "lol">{LOL}]>' + mjcf("&l11;"), "has a document type"),
}


def refused(folder: Path, text: str, kind: str) -> str:
    study = folder / "study"
    study.mkdir()
    (folder / "secret.xml").write_text(mjcf(""))
    path = study / "robot.xml"
    path.write_text(text, encoding="latin-1")
    began = time.process_time()
    with pytest.raises(ChainError) as told:
        UrdfFile(path, study) if kind == "urdf" else MjcfFile(path, study)
    assert time.process_time() - began < 5.0, "a bomb would take minutes"
    return str(told.value)


@pytest.mark.parametrize("case", URDF.values(), ids=URDF)
def test_a_hostile_urdf_is_refused_in_words(case: tuple[str, str], tmp_path: Path) -> None:
    assert case[1] in refused(tmp_path, case[0], "urdf")


@needs("mujoco")
@pytest.mark.parametrize("case", MJCF.values(), ids=MJCF)
def test_a_hostile_mjcf_is_refused_in_words(case: tuple[str, str], tmp_path: Path) -> None:
    assert case[1] in refused(tmp_path, case[0], "mjcf")


@needs("mujoco")
def test_what_an_included_part_names_lies_in_the_study_too(tmp_path: Path) -> None:
    study = tmp_path / "study"
    study.mkdir()
    (study / "part.xml").write_text(mjcf('<asset><mesh file="../a.stl"/></asset>'))
    (study / "robot.xml").write_text(mjcf('<include file="part.xml"/>'))
    with pytest.raises(ChainError, match=r"it names '\.\./a\.stl', and .* is not in the folder"):
        MjcfFile(study / "robot.xml", study)


@needs("mujoco")
def test_parts_and_meshes_beside_a_description_are_taken(tmp_path: Path) -> None:
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "arm.xml").write_text(
        '<mujoco><worldbody><body name="arm"><joint name="j"/><geom size="1"/></body></worldbody>'
        "</mujoco>"
    )
    path = tmp_path / "robot.xml"
    path.write_text(mjcf('<include file="parts/arm.xml"/>'))
    assert MjcfFile(path, tmp_path).joint_names == ["j"]
