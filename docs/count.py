"""Counter of the words, long pages and long sentences of what people read.

``python docs/count.py`` prints them; a test holds the limits (docs/writing.md).
"""

import re
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
LONGEST_SENTENCE, LONGEST_PAGE, LONGEST_README, LONGEST_CHANGELOG = 35, 1500, 700, 250

NOT_PROSE = re.compile(
    r"^ *```.*?^ *```$|<!--.*?-->|(?<=\n\n)(?: {4}[^\n]*\n+)+|^ *\|[^\n]*$"
    r"|^===.*?^===[^\n]*$|^#[^\n]*$"
    r"|^(?:Topic|Includes): [^\n]*$",
    re.MULTILINE | re.DOTALL,
)
"""Code, comments, tables, headings, and the topic of a decision."""

PARAGRAPH = re.compile(r"\n\s*\n|^\s*(?:[-*+]|\d+\.)\s+", re.MULTILINE)
END = re.compile(r"(?<=[.!?])[\")*_]*\s+(?=[\"'(*`\[]*(?:[A-Z0-9`]|labcrane|liblsl|pyxdf))")


def pages() -> list[Path]:
    """Return README and every page of the documentation."""
    return [ROOT / "README.md", *sorted(DOCS.rglob("*.md"))]


def words(path: Path) -> int:
    """Return how many words a file has, with its tables and code."""
    return len(path.read_text(encoding="utf-8").split())


def sentences(text: str) -> Iterator[str]:
    """Yield the sentences of a page; code is one word, a link is its text."""
    text = NOT_PROSE.sub("\n\n", text)
    text = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", re.sub(r"`[^`]+`", "`code`", text))
    for paragraph in PARAGRAPH.split(text):
        yield from (found for found in END.split(" ".join(paragraph.split())) if found)


def long_sentences(text: str) -> list[str]:
    """Return the sentences of a page that have too many words."""
    return [each for each in sentences(text) if len(each.split()) > LONGEST_SENTENCE]


def long_pages() -> list[Path]:
    """Return the pages that have too many words; those of the reference may have them."""
    found = (page for page in pages() if DOCS / "reference" not in page.parents)
    return [page for page in found if words(page) > LONGEST_PAGE]


def report() -> str:
    """Return the counts, then each page and sentence that is too long."""
    changelog = ROOT / "CHANGELOG.md"
    decisions = sorted((DOCS / "decisions").glob("*.md"))
    rest = [page for page in pages()[1:] if page not in decisions]
    found = [(page, each) for page in pages() for each in long_sentences(page.read_text("utf-8"))]
    lines = [
        f"README.md: {words(ROOT / 'README.md')} words",
        f"docs: {sum(map(words, rest))} words on {len(rest)} pages",
        f"docs/decisions: {sum(map(words, decisions))} words on {len(decisions)} pages",
        f"CHANGELOG.md: {words(changelog)} words in {changelog_lines()} lines",
        f"pages over {LONGEST_PAGE} words: {len(long_pages())}",
        *(f"  {page.relative_to(ROOT)}: {words(page)}" for page in long_pages()),
        f"sentences over {LONGEST_SENTENCE} words: {len(found)}",
        *(f"  {page.relative_to(ROOT)}: {len(each.split())}: {each}" for page, each in found),
    ]
    return "\n".join([*lines, ""])


def changelog_lines() -> int:
    """Return how many lines the changelog has."""
    return len((ROOT / "CHANGELOG.md").read_text(encoding="utf-8").splitlines())


if __name__ == "__main__":
    sys.stdout.write(report())
