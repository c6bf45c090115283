"""docs/reference/input-limits.md says what the module of limits says."""

import re
from importlib import import_module
from pathlib import Path

from labcrane.limits import LIMITS, Limit

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "input-limits.md"


def row(name: str, limit: Limit) -> str:
    size = f"{limit.most:,} {limit.unit}"
    depth = limit.depth or ""
    return f"| {name} | {size} | {depth} | {limit.alphabet} | `{limit.door}` | {limit.otherwise} |"


def test_the_page_has_the_table_of_limits_and_no_other() -> None:
    found = re.search(r"<!-- limits -->\n(.*)\n<!-- end of limits -->", PAGE.read_text(), re.DOTALL)
    assert found
    _, _, *rows = found[1].splitlines()
    assert rows == [row(name, limit) for name, limit in LIMITS.items()]


def test_every_door_in_the_table_is_a_module() -> None:
    for limit in LIMITS.values():
        for door in limit.door.split(", "):
            import_module(door if door.startswith("labcrane_") else f"labcrane.{door}")
