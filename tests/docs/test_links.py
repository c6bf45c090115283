"""Links of the documentation lead somewhere."""

import re
from pathlib import Path

import pytest
from docs.page import ROOT

from labcrane.cli.app import commands

PAGES = sorted([ROOT / "README.md", ROOT / "plugins" / "README.md", *(ROOT / "docs").rglob("*.md")])
LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)")
MENTION = re.compile(
    r"`((?:docs|labcrane|plugins|protocols|tests|benchmarks)/[a-z0-9_./*-]+(?:\.[a-z]+|/))`"
)
HEADING = re.compile(r"^#+ (.+)$", re.MULTILINE)


def anchors(page: Path) -> set[str]:
    """Return what a link can jump to, as Python-Markdown names headings."""
    text = re.sub(r"```.*?```", "", page.read_text(), flags=re.DOTALL)
    words = (re.sub(r"[^\w\s-]", "", heading).strip().lower() for heading in HEADING.findall(text))
    return {re.sub(r"[-\s]+", "-", word) for word in words}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_to_pages_and_headings_that_exist(page: Path) -> None:
    for link in LINK.findall(re.sub(r"```.*?```", "", page.read_text(), flags=re.DOTALL)):
        if link.startswith("https://"):
            continue  # test_links_to_others_are_listed
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        assert target.exists(), f"{page.relative_to(ROOT)} links {link}"
        if anchor and target.suffix == ".md":
            assert anchor in anchors(target), f"{page.relative_to(ROOT)}: no heading {link}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_files_that_are_named_exist(page: Path) -> None:
    for name in MENTION.findall(page.read_text()):
        assert list(ROOT.glob(name.rstrip("/"))), f"{page.relative_to(ROOT)} names {name}"


COMMAND = re.compile(r"`(?:\.venv/bin/)?labcrane ([a-z][a-z-]*)")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_commands_that_are_named_exist(page: Path) -> None:
    whole = commands([])
    known = {command.name for command in whole.registered_commands}
    known |= {group.name for group in whole.registered_groups}
    named = set(COMMAND.findall(page.read_text()))
    assert named <= known, f"{page.relative_to(ROOT)} names {named - known}"


def test_links_to_others_are_listed(record_property) -> None:
    # They are not fetched: a page of somebody else's must not decide whether our tests pass.
    found = {link for page in PAGES for link in LINK.findall(page.read_text()) if "://" in link}
    for link in sorted(found):
        record_property("link", link)
        assert link.startswith("https://"), link


def test_every_page_is_in_the_contents_of_the_site() -> None:
    # mkdocs itself only mentions a page that nobody would find.
    contents = (ROOT / "mkdocs.yml").read_text()
    written = [*(ROOT / "docs").glob("*.md"), *(ROOT / "docs" / "own").glob("*.md")]
    names = {str(page.relative_to(ROOT / "docs")) for page in written}
    assert not {name for name in names if f" {name}\n" not in contents}
