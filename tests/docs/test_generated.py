"""Pages that are read off the program have every key, every component and every signal."""

import re
from pathlib import Path
from types import ModuleType

import matplotlib.pyplot as plt
import numpy as np
import pytest
from docs.page import ROOT, program
from needs import need

from labcrane.protocol.protocol import protocol_model
from labcrane.registry.hookspecs import ROLES
from labcrane.testing import discover, load, main


@pytest.fixture(scope="module")
def generate() -> ModuleType:
    need("pybullet")  # a page has what each part records, and a part is built for that
    return program("generate")


@pytest.fixture(scope="module")
def pages(generate: ModuleType) -> dict[str, str]:
    return generate.pages()


def test_the_pages_in_the_repository_are_those_of_the_program(pages: dict[str, str]) -> None:
    behind = [
        name
        for name, text in pages.items()
        if (ROOT / "docs" / name).read_text(encoding="utf-8") != text
    ]
    assert behind == [], "run python docs/generate.py docs"


def rows(text: str) -> list[list[str]]:
    lines = [line for line in text.splitlines() if line.startswith("| `")]
    return [re.split(r"(?<!\\) \| ", line.strip("| ")) for line in lines]


def test_every_key_of_a_protocol_is_described(pages: dict[str, str]) -> None:
    page = pages["reference/protocol.md"]
    top, *_ = page.split("\n## ")
    assert {row[0].strip("`") for row in rows(top)} == set(protocol_model().model_fields)
    assert not [row[0] for row in rows(page) if not row[-1].strip()]
    assert {"Block", "OnFault", "StreamNeed"} <= set(re.findall(r"^## (\w+)$", page, re.M))


def test_every_component_and_every_setting_is_described(pages: dict[str, str]) -> None:
    registry = discover()
    for role, entry in ROLES.items():
        if not registry.offers[role]:
            continue
        page = pages[f"reference/{entry.word}.md"]
        for name, offer in registry.offers[role].items():
            part = page.split(f"\n## {name}\n")[1].split("\n## ")[0]
            written = offer.settings.model_json_schema().get("properties", {})
            # The words of a lab's file are filled in by the model itself.
            assert set(offer.settings.model_fields) - set(written) <= {"text"}
            for key in written:
                (row,) = [row for row in rows(part) if row[0] == f"`{key}`"][:1]
                assert len(row) == 4, f"{name}.{key} has no description"


def test_the_signals_are_those_that_a_recording_has(pages: dict[str, str]) -> None:
    assert (
        "| `joint.angle` | rad | `slew`, `shoulder`, `elbow`, `wrist` |"
        in (pages["reference/dynamics.md"])
    )
    assert (
        "| `left` | 1 | `x`, `y`, `twist`, `slider`, `trigger`, `connected` |"
        in (pages["reference/input.md"])
    )


def test_every_decision_is_listed(pages: dict[str, str]) -> None:
    listed = re.findall(r"\((\d{4}-[\w-]+\.md)\)", pages["decisions/index.md"])
    decisions = [path.name for path in (ROOT / "docs" / "decisions").glob("0*.md")]
    assert sorted(listed) == sorted(decisions)
    assert len(decisions) <= 60


CITED = re.compile(r"\bdecisions?[ /]0*(\d{1,4})\b", re.IGNORECASE)


def test_every_number_of_a_decision_leads_to_one_page(pages: dict[str, str]) -> None:
    of_pages = re.findall(r"^- \[(\d+)\. ", pages["decisions/index.md"], re.M)
    merged = re.findall(r"\(also ([\d, ]+)\)$", pages["decisions/index.md"], re.M)
    numbers = [*of_pages, *(number for each in merged for number in each.split(", "))]
    assert len(numbers) == len(set(numbers))
    cited = {
        number
        for top in ("labcrane", "plugins", "docs", "benchmarks", "examples", "tests")
        for path in (ROOT / top).rglob("*")
        if path.suffix in {".py", ".md", ".yaml"}
        for number in CITED.findall(path.read_text(encoding="utf-8"))
    }
    assert cited <= set(numbers)
    assert len(cited) > 10


@pytest.mark.parametrize(
    "page", sorted((ROOT / "docs" / "decisions").glob("0*.md")), ids=lambda page: page.name[:4]
)
def test_a_decision_has_a_short_title_and_at_most_400_words(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    number, title = re.fullmatch(r"# (\d+)\. (.+)", text.splitlines()[0]).groups()  # type: ignore[union-attr]
    assert int(number) == int(page.name[:4])
    assert len(title) <= 72
    assert len(text.split()) <= 420


def test_links_within_a_generated_page_lead_to_its_headings(pages: dict[str, str]) -> None:
    for name, text in pages.items():
        headings = {
            heading.lower().replace(" ", "-") for heading in re.findall(r"^## (.+)$", text, re.M)
        }
        assert set(re.findall(r"\(#([\w-]+)\)", text)) <= headings, name


def test_the_picture_is_small_and_its_study_is_right() -> None:
    assert (ROOT / "docs" / "picture.png").stat().st_size < 150_000
    study = load(ROOT / "docs" / "picture.yaml", discover())
    assert list(study.views) == ["examiner"]


@pytest.mark.long
def test_the_picture_is_what_its_command_makes(tmp_path: Path) -> None:
    study = str(ROOT / "docs" / "picture.yaml")
    assert main(["feedback", "preview", study, "--to", str(tmp_path)]) == 0
    shown = plt.imread(ROOT / "docs" / "picture.png")
    made = plt.imread(tmp_path / "examiner-012.png")
    # Renderers differ in the last bits; another moment or camera differs a lot.
    assert np.abs(shown[..., :3] - made[..., :3]).mean() < 0.01
    other = plt.imread(tmp_path / "examiner-000.png")
    assert np.abs(shown[..., :3] - other[..., :3]).mean() > 0.01
