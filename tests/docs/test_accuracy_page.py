"""The table of accuracy is the command's own, of every emulated device, and keeps its promises."""

import re
from pathlib import Path

import pytest
from streams.strangers import ALL
from streams.unkind_score import score, table_line

PAGE = (Path(__file__).parents[2] / "docs" / "reference" / "accuracy.md").read_text(
    encoding="utf-8"
)
LINES = re.findall(r"^\| .+ % \| .+ of \d+ \|$", PAGE, re.MULTILINE)
DRAWS = int(re.search(r"--draws (\d+) --page", PAGE)[1])


def cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.strip("|").split("|")]


def test_every_emulated_device_is_in_the_table_unkind_ones_first() -> None:
    assert [cells(line)[0] for line in LINES] == list(ALL)
    assert cells(LINES[-1])[0] == "steady, clean probes"


def test_the_table_shows_no_promise_that_is_broken() -> None:
    for line in LINES:
        _, _, stated, covered, _, passed = cells(line)
        assert float(covered.removesuffix(" %")) >= 95.0, line
        assert float(stated) <= 1.0 or passed.startswith("0 of"), line


@pytest.mark.slow
@pytest.mark.parametrize("row", ["60 Hz, single samples lost", "steady, clean probes"])
def test_the_table_is_what_the_command_gives(row: str) -> None:
    (line,) = (line for line in LINES if cells(line)[0] == row)
    again = table_line([score(row, seed, usual=True) for seed in range(DRAWS)])
    for told, now in zip(cells(line)[1:], cells(again)[1:], strict=True):
        numbers = ([float(each) for each in re.findall(r"[\d.]+", text)] for text in (told, now))
        assert next(numbers) == pytest.approx(next(numbers), rel=0.02, abs=0.0015)
