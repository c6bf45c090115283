"""Runs in parts: what has passed is noted and left out, and no test begins when the time is up."""

import subprocess
import sys
from pathlib import Path

import pytest

TESTS = """
import pytest

@pytest.mark.parametrize("number", range(4))
def test_it(number):
    assert number != {broken}
"""


def run_in(folder: Path, *words: str, broken: int = 9) -> str:
    (folder / "test_some.py").write_text(TESTS.format(broken=broken))
    (folder / "conftest.py").write_text("from parts import Parts, add_options, asked_for\n"
        "def pytest_addoption(parser):\n    add_options(parser)\n"
        "def pytest_configure(config):\n"
        "    if asked_for(config):\n        config.pluginmanager.register(Parts(config))\n"
    )  # fmt: skip
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-c", "/dev/null", "--rootdir", folder, *words],
        cwd=folder,
        # A file written twice in one second at one length looks the same to Python's cache.
        env={"PYTHONPATH": str(Path(__file__).parent), "PATH": "", "PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    return done.stdout + done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("processes", ["0", "2"])
def test_what_has_passed_is_noted_and_what_failed_is_run_again(
    tmp_path: Path, processes: str
) -> None:
    words = ("-n", processes, "--noted", "noted.txt")
    said = run_in(tmp_path, *words, broken=2)
    assert "3 passed, 1 failed, 0 left for another run; 0 had passed before" in said
    noted = (tmp_path / "noted.txt").read_text().splitlines()
    assert sorted(line.partition(" ")[2] for line in noted) == [
        f"test_some.py::test_it[{number}]" for number in (0, 1, 3)
    ]
    said = run_in(tmp_path, *words)
    assert "1 passed, 0 failed, 0 left for another run; 3 had passed before" in said
    assert "3 deselected" in said or processes != "0"


@pytest.mark.slow
def test_no_test_begins_when_the_time_is_up(tmp_path: Path) -> None:
    said = run_in(tmp_path, "-n", "0", "--for", "0", "--noted", "noted.txt")
    assert "0 passed, 0 failed, 4 left for another run; 0 had passed before" in said
    assert not (tmp_path / "noted.txt").exists()
