"""The page of the architecture draws the contract as it is, and its ways can be walked."""

import ast
import re
from pathlib import Path

import pytest
from docs.page import ROOT, program

PAGE = (ROOT / "docs" / "architecture.md").read_text()
PATHS = (ROOT / "docs" / "data-paths.md").read_text()
WAYS = dict(re.findall(r"^## (.*?)\n(.*?)(?=^#|\Z)", PATHS, re.M | re.S))
STEP = re.compile(r"^(\d+)\. `([\w.]+)`: (.*)$", re.M)
IMPORTED, IMPORTS = re.compile(r"\(imported by (\d+)\)"), re.compile(r"\(imports (\d+)\)")
BOTH = re.compile(r"\(both know `([^`]+)`: (\d+)\)")


def source(module: str) -> str:
    top = ROOT if module.startswith("labcrane.") else ROOT / "plugins"
    return Path(top, *module.split(".")).with_suffix(".py").read_text()


def imported(module: str) -> set[str]:
    found = set()
    for node in ast.walk(ast.parse(source(module))):
        if isinstance(node, ast.ImportFrom) and node.module:
            found |= {node.module, *(f"{node.module}.{each.name}" for each in node.names)}
    return found


def test_the_picture_is_that_of_the_contract() -> None:
    assert program("generate").with_floors(PAGE) == PAGE, "python docs/generate.py --architecture"
    assert "| `session` |" in PAGE


@pytest.mark.parametrize("way", WAYS)
def test_every_step_of_a_way_is_joined_to_an_earlier_one(way: str) -> None:
    steps = STEP.findall(WAYS[way])
    assert len(steps) == len(re.findall(r"^\d+\.", WAYS[way], re.M)) >= 7
    modules = {number: module for number, module, _ in steps}
    assert list(modules) == [str(1 + at) for at in range(len(steps))]
    for number, module, text in steps:
        assert source(module)
        if by := IMPORTED.search(text):
            assert int(by[1]) < int(number)
            assert module in imported(modules[by[1]]), f"{modules[by[1]]} imports no {module}"
        elif what := IMPORTS.search(text):
            assert int(what[1]) < int(number)
            assert modules[what[1]] in imported(module), f"{module} imports no {modules[what[1]]}"
        elif both := BOTH.search(text):
            assert int(both[2]) < int(number)
            for each in (module, modules[both[2]]):
                assert re.search(rf"\b({both[1]})\b", source(each)), f"{each}: no {both[1]}"
        else:
            assert number == "1", f"{way}: step {number} is joined to none"


def test_every_place_exists() -> None:
    table = PAGE.split("## Where would I put")[1]
    here = [ROOT / "labcrane" / path for path in re.findall(r"`([a-z_]+/[\w/.]*)`", table)]
    assert len(here) > 15
    assert not [path for path in here if not path.exists()]
