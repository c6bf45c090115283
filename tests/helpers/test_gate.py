"""A test that fails makes its run red, and is the only one that a later stage runs again."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from gate import without_group

TESTS = """
from pathlib import Path
import pytest

@pytest.mark.parametrize("number", range(6))
def test_it(number):
    Path(f"tried-{number}").touch()
    assert number not in __FAILING__
"""
CONFTEST = """
import os
from pathlib import Path
import gate
from gate import GATE, PASSED, Gate, leave_out_passed

gate.QUICK_PROCESSOR_S = 0.0

def pytest_configure(config):
    if GATE in os.environ and not hasattr(config, "workerinput"):
        passed = Path(os.environ[PASSED])
        config.pluginmanager.register(Gate(config, Path(os.environ.pop(GATE)), passed))

def pytest_collection_modifyitems(config, items):
    leave_out_passed(config, items)
"""


def gate_in(folder: Path, failing: tuple[int, ...], processes: str) -> tuple[int, dict]:
    """Return the status, and what is noted of the newest run."""
    (folder / "test_some.py").write_text(TESTS.replace("__FAILING__", str(failing)))
    (folder / "conftest.py").write_text(CONFTEST)
    (folder / "pytest.ini").write_text("[pytest]\n")
    here = {
        "PYTHONPATH": str(Path(__file__).parent), "PATH": "",
        "LABCRANE_GATE": "runs", "LABCRANE_PASSED": "passed",
    }  # fmt: skip
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-n", processes],
        cwd=folder, env=here, capture_output=True, check=False,
    )  # fmt: skip
    newest = (folder / "runs").read_text().splitlines()[-1]
    return done.returncode, json.loads(newest)


@pytest.mark.slow
@pytest.mark.parametrize("processes", ["0", "2"])
def test_what_passed_in_one_stage_is_not_run_in_the_next(tmp_path: Path, processes: str) -> None:
    status, noted = gate_in(tmp_path, (2, 5), processes)
    assert (status, noted["passed"], noted["failed"], noted["skipped"]) == (1, 4, 2, 0)
    passed = [f"test_some.py::test_it[{number}]" for number in (0, 1, 3, 4)]
    assert (tmp_path / "passed").read_text().split() == passed
    for tried in tmp_path.glob("tried-*"):
        tried.unlink()
    status, noted = gate_in(tmp_path, (), processes)
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
