"""Robots' descriptions of strangers: bombs, refused in words at once."""

import time
from pathlib import Path

import pytest

from labcrane.machines.descriptions.chain import ChainError
from labcrane.machines.descriptions.urdf_file import UrdfFile

LOL = "".join(f'<!ENTITY l{at} "{f"&l{at - 1};" * 10}">' for at in range(1, 12))
LINKS = "".join(f'<link name="l{at}"/>' for at in range(600))


def urdf(inside: str, before: str = "") -> str:
    return f'{before}<robot name="r">{inside}</robot>'


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


@pytest.mark.parametrize("case", URDF.values(), ids=URDF)
def test_a_hostile_urdf_is_refused_in_words(case: tuple[str, str], tmp_path: Path) -> None:
    path = tmp_path / "robot.xml"
    path.write_text(case[0], encoding="latin-1")
    began = time.process_time()
    with pytest.raises(ChainError) as told:
        UrdfFile(path, tmp_path)
    assert time.process_time() - began < 5.0, "a bomb would take minutes"
    assert case[1] in str(told.value)
