"""Runs in parts: what has passed is left out, and no test begins that might not end in time."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

TESTS = """
import pytest

@pytest.mark.soak
@pytest.mark.xdist_group("one process")
@pytest.mark.parametrize("number", range(4))
def test_it(number, record_property):
    record_property("number", number)
    assert number != {broken}

@pytest.mark.timeout(500)
def test_that_may_take_long():
    pass
"""
CONFTEST = """
import os
from pathlib import Path
from parts import NAME, Parts, add_options, asked_for
from second_try import GATE, SecondTry

def pytest_addoption(parser):
    add_options(parser)

def pytest_configure(config):
    if asked_for(config):
        config.pluginmanager.register(Parts(config), NAME)
    if GATE in os.environ and not hasattr(config, "workerinput"):
        config.pluginmanager.register(SecondTry(config, Path(os.environ.pop(GATE))))
"""


INI = """
[pytest]
addopts = --dist loadgroup
timeout = 100
markers =
    soak: many
"""


def run_in(folder: Path, *words: str, broken: int = 9) -> tuple[int, str, dict]:
    """Return the status, what was said, and what is noted for the evidence.

    As in the soak stage, the tests are a copy, and the noted file is in the project's own folder.
    """
    copy = folder / "copy"
    copy.mkdir(exist_ok=True)
    (copy / "test_some.py").write_text(TESTS.format(broken=broken))
    (copy / "conftest.py").write_text(CONFTEST)
    for each in (folder, copy):
        (each / "pytest.ini").write_text(INI)
    (copy / "runs").unlink(missing_ok=True)
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", f"--noted={folder / 'noted.txt'}", *words],
        cwd=copy,
        # A file written twice in one second at one length looks the same to Python's cache.
        env={
            "PYTHONPATH": str(Path(__file__).parent), "PATH": "", "PYTHONDONTWRITEBYTECODE": "1",
            "LABCRANE_GATE": "runs",
        },
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    said = done.stdout + done.stderr
    return done.returncode, said, json.loads((copy / "runs").read_text() or "{}")


def noted_in(folder: Path) -> list[str]:
    return [line.partition(" ")[2] for line in (folder / "noted.txt").read_text().splitlines()]


@pytest.mark.slow
@pytest.mark.parametrize("processes", ["0", "2"])
def test_what_has_passed_is_noted_and_what_failed_is_run_again(
    tmp_path: Path, processes: str
) -> None:
    status, said, line = run_in(tmp_path, "-n", processes, broken=2)
    assert status == 1
    assert "4 of 5 have passed, 0 of them before; 1 failed; 0 are left for another run" in said
    assert sorted(noted_in(tmp_path)) == [
        *(f"test_some.py::test_it[{number}]" for number in (0, 1, 3)),
        "test_some.py::test_that_may_take_long",
    ]
    assert (line["passed"], line["failed"], line["parts"]["of"]) == (4, 1, 5)
    status, said, line = run_in(tmp_path, "-n", processes)
    assert status == 0
    assert "5 of 5 have passed, 4 of them before; 0 failed; 0 are left for another run" in said
    assert (line["passed"], line["failed"], line["skipped"]) == (5, 0, 0)
    assert line["parts"] == {
        "before": 4, "passed": 5, "no_time": 0, "of": 5, "commits": ["no-commit"],
    }  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("processes", ["0", "2"])
def test_when_all_has_passed_the_next_run_tries_everything_anew(
    tmp_path: Path, processes: str
) -> None:
    assert run_in(tmp_path, "-n", processes)[0] == 0
    assert not (tmp_path / "noted.txt").exists()
    assert len((tmp_path / "noted.txt.complete").read_text().splitlines()) == 5
    assert run_in(tmp_path, "-n", processes)[2]["parts"]["before"] == 0


@pytest.mark.slow
@pytest.mark.parametrize("processes", ["0", "2"])
def test_a_run_that_finds_all_noted_has_passed(tmp_path: Path, processes: str) -> None:
    run_in(tmp_path, "-n", "0")
    (tmp_path / "noted.txt.complete").rename(tmp_path / "noted.txt")
    status, said, line = run_in(tmp_path, "-n", processes)
    assert (status, line["status"], line["passed"], line["skipped"]) == (0, 0, 5, 0)
    assert "5 of 5 have passed, 5 of them before" in said
    assert not (tmp_path / "noted.txt").exists()


@pytest.mark.slow
@pytest.mark.parametrize("processes", ["0", "2"])
def test_only_tests_that_end_in_time_begin(tmp_path: Path, processes: str) -> None:
    _, said, line = run_in(tmp_path, "-n", processes, "--for", "50")
    assert "0 of 5 have passed, 0 of them before; 5 failed" in said
    assert "it may take 500 s, which --for 50 never leaves for it" in said
    status, said, line = run_in(tmp_path, "-n", processes, "--for", "500")
    assert status == 1
    assert "it may take 500 s, which --for 500 never leaves for it" in said
    assert line["second_try"] == [], "the next part tries it again"
    assert (line["passed"], line["skipped"], line["parts"]["no_time"]) == (4, 0, 0)


@pytest.mark.slow
def test_the_tests_that_may_take_longest_begin_first(tmp_path: Path) -> None:
    _, said, _ = run_in(tmp_path, "-n", "0", "-vv")
    begun = re.findall(r"^test_some.py::(\S+) PASSED", said, re.MULTILINE)
    assert begun == ["test_that_may_take_long", *(f"test_it[{number}]" for number in range(4))]


@pytest.mark.slow
def test_what_was_noted_of_changed_files_counts_for_nothing(tmp_path: Path) -> None:
    (tmp_path / "noted.txt").write_text("abc1234+ test_some.py::test_it[1]\n")
    _, said, _ = run_in(tmp_path, "-n", "0", broken=0)
    assert "4 of 5 have passed, 0 of them before" in said


@pytest.mark.slow
@pytest.mark.parametrize("processes", ["0", "2"])
def test_figures_of_long_tests_are_kept_test_by_test(tmp_path: Path, processes: str) -> None:
    (figure,) = run_in(tmp_path, "-n", processes)[2]["figures"]
    assert figure == {
        "test": "test_some.py::test_it", "what": "number", "values": 4, "largest": 3,
    }  # fmt: skip
