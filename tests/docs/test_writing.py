"""The turns of phrase that docs/writing.md refuses are in no page, message, comment or example."""

import re

import pytest
from docs.page import ROOT

PAGE = ROOT / "docs" / "writing.md"
PLACES = ("labcrane", "plugins", "protocols", "examples", "benchmarks", "docs", "*.md", ".ci")
KINDS = {".py", ".md", ".yaml", ".yml", ".js", ".css", ".html", ".toml", ".jinja", ".R", ".m", ""}


def patterns() -> list[re.Pattern[str]]:
    block = PAGE.read_text(encoding="utf-8").split("```regex\n")[1].split("```")[0]
    return [re.compile(line, re.MULTILINE) for line in block.splitlines()]


def refused(text: str) -> list[str]:
    """Return the refused words of a text, each with its line."""
    lines = text.splitlines()
    found = [each for pattern in patterns() for each in pattern.finditer(text)]
    return [
        f"{number + 1}: {each[0]!r} in: {lines[number].strip()}"
        for each in found
        for number in [text.count("\n", 0, each.start())]
    ]


@pytest.mark.slow
def test_no_text_has_a_refused_turn_of_phrase() -> None:
    files = {
        path
        for place in PLACES
        for top in ROOT.glob(place)
        for path in ([top] if top.is_file() else top.rglob("*"))
        if path.is_file() and path.suffix in KINDS and "__pycache__" not in path.parts
    }
    found = {
        str(path.relative_to(ROOT)): words
        for path in sorted(files - {PAGE})
        if (words := refused(path.read_text(encoding="utf-8")))
    }
    assert not found
