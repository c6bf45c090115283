"""README and docs stay short: words, pages, and sentences have limits."""

from pathlib import Path

import pytest
from docs.page import ROOT, program

count = program("count")


def test_the_readme_and_the_changelog_are_short() -> None:
    assert count.words(ROOT / "README.md") <= count.LONGEST_README == 700
    assert count.changelog_lines() <= count.LONGEST_CHANGELOG == 250


def test_only_pages_of_the_reference_are_longer_than_1500_words() -> None:
    assert count.long_pages() == []
    assert any(count.words(page) > count.LONGEST_PAGE for page in count.pages())


@pytest.mark.parametrize("page", count.pages(), ids=lambda page: str(page.relative_to(ROOT)))
def test_no_sentence_has_more_than_35_words(page: Path) -> None:
    assert count.long_sentences(page.read_text(encoding="utf-8")) == []
