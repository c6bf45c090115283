"""What is installed, found as Python's own reader finds it."""

from importlib.metadata import entry_points
from pathlib import Path

import pytest

from labcrane.registry.entry_points import Declared, declared

GROUPS = ("labcrane", "labcrane.offers", "labcrane.commands")


@pytest.mark.parametrize("group", GROUPS)
def test_the_entry_points_of_what_is_installed_are_those_that_python_finds(group: str) -> None:
    found = [(point.name, point.value) for point in declared() if point.group == group]
    assert found
    assert sorted(found) == sorted((each.name, each.value) for each in entry_points(group=group))


def test_other_groups_and_comments_are_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(tmp_path, "lamp-1.0.dist-info", LINES)
    monkeypatch.setattr("sys.path", [str(tmp_path)])
    assert [*declared()] == [
        Declared("labcrane", "lamp", "labcrane_lamp"),
        Declared("labcrane.offers", "blink", "labcrane_lamp"),
    ]


def test_of_a_package_that_is_found_twice_the_first_on_the_path_counts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(tmp_path / "new", "Lamp-2.0.dist-info", "[labcrane]\nlamp = new_lamp\n")
    write(tmp_path / "old", "lamp-1.0.dist-info", "[labcrane]\nlamp = old_lamp\n")
    monkeypatch.setattr("sys.path", [str(tmp_path / "new"), str(tmp_path / "old")])
    assert [*declared()] == [Declared("labcrane", "lamp", "new_lamp")]
    assert {each.value for each in entry_points(group="labcrane")} == {"new_lamp"}


LINES = """\
[console_scripts]
lamp = labcrane_lamp:main

[labcrane]
# its name, and its module
lamp = labcrane_lamp

[labcrane.offers]
blink=labcrane_lamp

[labcranes]
crane = another
"""


def write(folder: Path, package: str, lines: str) -> None:
    (folder / package).mkdir(parents=True)
    (folder / package / "entry_points.txt").write_text(lines)
    name, version = package.removesuffix(".dist-info").split("-")
    metadata = f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n"
    (folder / package / "METADATA").write_text(metadata)
