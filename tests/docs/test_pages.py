"""Every block of code and every command of the documentation does what the page says."""

from collections import Counter
from pathlib import Path

import pytest
from docs.bare_machine import commands
from docs.page import PAGES, ROOT, Reader, blocks
from needs import missing, need

RUN = {"python", "sh", "r", "octave", "matlab", "yaml", "toml", "json", "xml", "regex", ""}
"""Languages of blocks; one without a language lists files that are there."""

FIRST = {"README.md", "first-study.md"}
"""Pages that every run of the tests follows; the others are slow."""

MOST_NOT_RUN = 0
"""How many blocks may be marked as not run; each has its reason beside it."""


def name(page: Path) -> str:
    return str(page.relative_to(ROOT))


def long(page: Path) -> bool:
    return any("long" in block.marks for block in blocks(page))


@pytest.mark.parametrize(
    "page",
    [
        pytest.param(page, id=name(page), marks=() if page.name in FIRST else pytest.mark.slow)
        for page in PAGES
    ],
)
def test_a_page_can_be_followed_from_top_to_bottom(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, recorded: dict[str, str]
) -> None:
    follow(page, Reader(tmp_path, recorded), tmp_path, monkeypatch, also_long=False)


@pytest.mark.long
@pytest.mark.timeout(1200)
@pytest.mark.parametrize(
    "page", [page for page in PAGES if long(page)], ids=lambda page: str(page.relative_to(ROOT))
)
def test_a_page_that_takes_long_can_be_followed_to_its_end(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, recorded: dict[str, str]
) -> None:
    follow(page, Reader(tmp_path, recorded), tmp_path, monkeypatch, also_long=True)


def follow(
    page: Path, reader: Reader, folder: Path, monkeypatch: pytest.MonkeyPatch, *, also_long: bool
) -> None:
    monkeypatch.chdir(folder)
    monkeypatch.syspath_prepend(folder)
    lacking: set[str] = set()
    for block in blocks(page):
        if (
            block.why_not
            or "bare machine" in block.marks
            or ("long" in block.marks and not also_long)
        ):
            continue
        if here := [name for name in block.needs if missing(name)]:
            lacking.update(here)
            reader.prepare(block)  # blocks that follow may need it
            continue
        try:
            reader.follow(block)
        except BaseException as error:
            where = f"{page.relative_to(ROOT)}:{block.line}"
            error.add_note(
                f"{where}: this {block.language} block cannot be followed; correct it, or write "
                "<!-- not run: REASON --> on the line above (tests/docs/page.py has all marks)"
            )
            raise
    need(*sorted(lacking))  # the rest of the page was followed


def test_blocks_have_a_language_that_is_run_or_a_reason_why_not() -> None:
    unknown = Counter(
        f"{page.name}: {block.language}"
        for page in PAGES
        for block in blocks(page)
        if block.language not in RUN and not block.why_not
    )
    assert not unknown


def test_what_begins_on_a_bare_machine_is_run_by_the_gate() -> None:
    marked = [b.text for page in PAGES for b in blocks(page) if "bare machine" in b.marks]
    assert sorted(commands()) == sorted(marked)
    gate = (ROOT / ".ci" / "stages").read_text()
    assert 'tests/docs/bare_machine.py >"$work/commands"\n' in gate
    assert 'bash -euo pipefail "$work/commands" | tee "$work/said"\n' in gate


def test_few_blocks_are_not_run_and_each_says_why(record_property) -> None:
    reasons = [
        f"{page.relative_to(ROOT)}:{block.line}: {block.why_not}"
        for page in PAGES
        for block in blocks(page)
        if block.why_not
    ]
    for reason in reasons:
        record_property("not run", reason)
    assert len(reasons) <= MOST_NOT_RUN
    assert all(len(reason.split(": ", 1)[1]) > 10 for reason in reasons)
