"""What failed in the gate is run once more, alone; a test that fails twice is red."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from second_try import without_group

TESTS = """
from pathlib import Path
import pytest

@pytest.mark.parametrize("number", range(6))
def test_it(number):
    tried = Path(f"tried-{number}")
    before = tried.exists()
    tried.touch()
    assert number not in __ALWAYS__
    assert before or number not in __ONCE__
"""
CONFTEST = """
import os
from pathlib import Path
import second_try
from second_try import GATE, PASSED, SecondTry, leave_out_passed

second_try.QUICK_PROCESSOR_S = 0.0

def pytest_configure(config):
    if GATE in os.environ and not hasattr(config, "workerinput"):
        passed = Path(os.environ[PASSED])
        config.pluginmanager.register(SecondTry(config, Path(os.environ.pop(GATE)), passed))

def pytest_collection_modifyitems(config, items):
    leave_out_passed(config, items)
"""


def gate_in(
    folder: Path,
    *words: str,
    once: tuple[int, ...] = (),
    always: tuple[int, ...] = (),
    processes: str = "0",
    more: str = "",
) -> tuple[int, str, dict]:
    """Return the status, what was said, and what is noted of the newest run."""
    tests = TESTS.replace("__ALWAYS__", str(always)).replace("__ONCE__", str(once)) + more
    (folder / "test_some.py").write_text(tests)
    (folder / "conftest.py").write_text(CONFTEST)
    (folder / "pytest.ini").write_text("[pytest]\n")
    here = {
        "PYTHONPATH": str(Path(__file__).parent), "PATH": "",
        "LABCRANE_GATE": "runs", "LABCRANE_PASSED": "passed",
    }  # fmt: skip
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-n", processes, *words],
        cwd=folder, env=here, capture_output=True, text=True, check=False,
    )  # fmt: skip
    newest = (folder / "runs").read_text().splitlines()[-1]
    return done.returncode, done.stdout + done.stderr, json.loads(newest)


@pytest.mark.slow
@pytest.mark.parametrize("processes", ["0", "2"])
def test_what_fails_once_is_named_and_its_run_is_green(tmp_path: Path, processes: str) -> None:
    status, said, noted = gate_in(tmp_path, once=(1, 4), processes=processes)
    both = {"test_some.py::test_it[1]", "test_some.py::test_it[4]"}
    assert (status, set(noted["second_try"])) == (0, both)
    assert "needed a second try: test_some.py::test_it[" in said
    assert (noted["passed"], noted["failed"], noted["skipped"]) == (4, 2, 0)


@pytest.mark.slow
def test_what_fails_twice_is_red(tmp_path: Path) -> None:
    status, said, noted = gate_in(tmp_path, once=(1,), always=(2,))
    assert (status, noted["status"], noted["second_try"]) == (1, 1, [])
    assert "failed twice: test_some.py::test_it[1], test_some.py::test_it[2]" in said


@pytest.mark.slow
def test_more_than_three_in_all_stages_of_a_gate_get_no_second_try(tmp_path: Path) -> None:
    assert gate_in(tmp_path, once=(0, 1))[0] == 0
    (tmp_path / "passed").unlink()
    for tried in tmp_path.glob("tried-*"):
        tried.unlink()
    status, said, _ = gate_in(tmp_path, once=(0, 1))
    assert status == 1
    assert "no second try: 4 tests failed in this gate, 3 may" in said


@pytest.mark.slow
@pytest.mark.parametrize("processes", ["0", "2"])
def test_what_passed_in_one_stage_is_not_run_in_the_next(tmp_path: Path, processes: str) -> None:
    gate_in(tmp_path, always=(2, 5), processes=processes)
    passed = [f"test_some.py::test_it[{number}]" for number in (0, 1, 3, 4)]
    assert (tmp_path / "passed").read_text().split() == passed
    for tried in tmp_path.glob("tried-*"):
        tried.unlink()
    status, _, noted = gate_in(tmp_path, processes=processes)
    assert (status, noted["passed"]) == (0, 2)
    assert sorted(path.name for path in tmp_path.glob("tried-*")) == ["tried-2", "tried-5"]


@pytest.mark.parametrize(
    ("nodeid", "name"),
    [
        ("tests/test_a.py::test_b", "tests/test_a.py::test_b"),
        ("tests/test_a.py::test_b@tests/test_a.py", "tests/test_a.py::test_b"),
        ("tests/test_a.py::test_b[x@y]", "tests/test_a.py::test_b[x@y]"),
        ("tests/test_a.py::test_b[x@y]@group", "tests/test_a.py::test_b[x@y]"),
    ],
)
def test_a_name_keeps_its_own_at_sign_and_loses_that_of_its_group(nodeid: str, name: str) -> None:
    assert without_group(nodeid) == name
