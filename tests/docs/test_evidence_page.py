"""Pages say of systems and wheels what the record of the stages says, and nothing else."""

import json
import re
from pathlib import Path
from typing import Any

import pytest
from docs.page import ROOT
from gate_program import gate_program
from programs import ran

EVIDENCE = gate_program("evidence")
RECORD = json.loads((ROOT / EVIDENCE.DATA).read_text(encoding="utf-8"))
NOTHING: dict[str, Any] = {
    "stages": {},
    "systems": [],
    "wheels": {"date": "2026-11-22", "commit": "abc", "found": []},
}
RUN = {
    "status": 0, "system": "Linux", "python": "3.14.1", "what": "quick tests", "passed": 7,
    "failed": 0, "skipped": 2, "processor_s": 5,
}  # fmt: skip


@pytest.fixture(autouse=True)
def in_the_repository(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)


def rows(table: str, system: str) -> list[list[str]]:
    cells = [[cell.strip() for cell in line.split("|")[1:-1]] for line in table.splitlines()]
    return [row[1:] for row in cells if row and row[0] == system]


def after(folder: Path, stage: str, *runs: dict[str, Any], ending: str = "passed") -> Any:
    path = folder / "runs"
    path.write_text("".join(json.dumps(run) + "\n" for run in runs), encoding="utf-8")
    return EVIDENCE.kept(NOTHING, stage, ending, ("12", "5"), path, "abc1234")


def test_the_pages_are_those_of_the_record() -> None:
    compatibility = EVIDENCE.COMPATIBILITY.read_text(encoding="utf-8")
    for page, text in EVIDENCE.pages(RECORD, compatibility).items():
        assert page.read_text(encoding="utf-8") == text, "run .ci/evidence"


def test_a_system_without_a_run_is_said_to_have_none() -> None:
    table = EVIDENCE.systems_table(NOTHING)
    for system in ("Linux", "Windows under Wine", "Windows", "macOS"):
        assert {row[3] for row in rows(table, system)} == {"no run recorded"}
    assert [row[0] for row in rows(table, "Linux")] == ["3.11", "3.12", "3.13", "3.14"]


def test_a_stage_is_kept_for_each_system_and_python_that_it_ran_on(tmp_path: Path) -> None:
    demo = RUN | {"what": "labcrane demo", "passed": 0, "skipped": 0}
    broken = RUN | {"python": "3.12.3", "status": 1, "failed": 3}
    record = after(tmp_path, "pythons", demo, RUN, broken, ending="failed")
    table = EVIDENCE.systems_table(record)
    by_python = {row[0]: row[1:] for row in rows(table, "Linux")}
    assert by_python["3.14"][:6] == [
        "pythons", "labcrane demo; quick tests", "passed", "7", "0", "2",
    ]  # fmt: skip
    assert by_python["3.12"][2:6] == ["failed", "7", "3", "2"]
    assert by_python["3.11"][2] == "no run recorded"
    assert record["stages"]["pythons"]["ended"] == "failed"
    assert record["stages"]["pythons"]["passed"] == 14
    assert by_python["3.14"][-1] == "abc1234"


@pytest.mark.parametrize(
    ("said", "counts"),
    [
        ("== 3 passed, 1 failed in 2.00s ==\n1 passed, 2 skipped in 61.5s (0:01:01)\n", (4, 1, 2)),
        ("2 failed, 1 error in 1.1s", (0, 3, 0)),
        ("what was recorded: 3 passed by", (0, 0, 0)),
    ],
)
def test_tests_are_counted_in_what_a_command_says(said: str, counts: tuple[int, ...]) -> None:
    run = EVIDENCE.noted("Windows under Wine", "3.11", "a study day", "1", said)
    assert (run["passed"], run["failed"], run["skipped"]) == counts
    assert run["status"] == 1


def test_every_stage_of_the_nightly_run_has_a_row() -> None:
    nightly = (ROOT / ".ci" / "nightly").read_text(encoding="utf-8")
    known = re.search(r'^known="(.+?)" of_gate="(.+?)"$', nightly, re.M)
    assert known
    assert [*known[1].split(), *known[2].split()] == list(EVIDENCE.STAGES)


def test_a_python_that_is_not_there_is_noted_as_not_tried_with_the_reason(tmp_path: Path) -> None:
    runs = tmp_path / "runs"
    done = ran(
        ["bash", "-euo", "pipefail", "-c", ". .ci/stages; installed_on 3.99; on_python 3.99"],
        env={"LABCRANE_RUNS": str(runs)},
    )
    assert (done.returncode, done.stderr) == (0, "")
    (line,) = EVIDENCE.lines_of(runs)
    assert line["untried"] == "this computer has no Python 3.99"
    record = EVIDENCE.kept(NOTHING, "pythons", "passed", ("1", "1"), runs, "abc1234")
    why = "not tried: this computer has no Python 3.99"
    assert record["stages"]["pythons"]["ended"] == why
    (row,) = (row for row in rows(EVIDENCE.systems_table(record), "Linux") if row[0] == "3.99")
    assert row[3:7] == [why, "0", "0", "0"]


def test_a_stage_that_passed_in_part_names_what_was_not_tried(tmp_path: Path) -> None:
    missing = EVIDENCE.untried("Linux", "3.12", "quick tests", "this computer has no Python 3.12")
    record = after(tmp_path, "pythons", RUN, missing)
    why = "not tried: this computer has no Python 3.12"
    assert record["stages"]["pythons"]["ended"] == f"passed; {why}"
    assert {run["python"]: run["ended"] for run in record["systems"]} == {
        "3.14": "passed",
        "3.12": why,
    }


@pytest.mark.parametrize(
    "stage", [name for name in EVIDENCE.STAGES if name not in EVIDENCE.UNCOUNTED]
)
@pytest.mark.parametrize("runs", [[], [RUN | {"passed": 0}]], ids=["no run", "none passed"])
def test_a_stage_in_which_no_test_passed_is_not_passed(
    tmp_path: Path, stage: str, runs: list[dict[str, Any]]
) -> None:
    record = after(tmp_path, stage, *runs)
    assert record["stages"][stage]["ended"] == "not tried: no test ran"
    assert {run["ended"] for run in record["systems"]} <= {"not tried: no test ran"}


def test_no_row_of_the_record_has_passed_without_a_test() -> None:
    counted = [*RECORD["systems"]]
    counted += [one for name, one in RECORD["stages"].items() if name not in EVIDENCE.UNCOUNTED]
    assert [one for one in counted if one["ended"].startswith("passed") and not one["passed"]] == []
