"""Every shipped study and variant of one gives a report of everyone who was simulated."""

import shutil
from pathlib import Path

import pytest

from labcrane.testing import main

PROTOCOLS = Path(__file__).parents[2] / "protocols"
QUICKEST = "whole"
SHIPPED = [
    path.relative_to(PROTOCOLS)
    for path in sorted(PROTOCOLS.glob("*/*.yaml"))
    if "\nlabcrane: 1" in path.read_text(encoding="utf-8")
]


@pytest.mark.parametrize(
    "protocol",
    [
        pytest.param(
            path,
            id=str(path),
            marks=pytest.mark.slow if QUICKEST in path.parts else pytest.mark.long,
        )
        for path in SHIPPED
    ],
)
def test_a_shipped_study_gives_a_report_whatever_moves_the_machine(
    protocol: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(PROTOCOLS / protocol.parent, tmp_path / "study")
    people = tmp_path / "people"
    path = str(tmp_path / "study" / protocol.name)
    assert main(["simulate", path, "--participants", "2", "--out", str(people)]) == 0
    words = ["report", str(people), "--include", "simulated", "--out", str(tmp_path / "report")]
    assert main(words) == 0
    assert "left out" not in capsys.readouterr().out
    assert (tmp_path / "report" / "report.html").is_file()
