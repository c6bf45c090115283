"""Runs that take hours, in parts: what has passed is noted and not run again, and time is bounded.

``pytest -m soak tests/faults/test_kills.py -n 8 --noted kills.txt --for 1200`` begins no test later
than 1,200 s from its start, writes what passes into ``kills.txt`` with the commit it passed on, and
ends by saying how much of all is done; the same line again goes on from there. What fails is never
noted: it is run again.
"""

import os
import shutil
import subprocess
import time
from pathlib import Path

import pytest
from second_try import without_group

BEGAN = "LABCRANE_TESTS_BEGAN"
"""When a run began, by the clock that its processes share."""

NO_TIME = "no time is left for it: --for"


class Parts:
    """Leaves out what is noted, and notes what passes; workers are told what was noted before.

    Parameters
    ----------
    config
        Of this process: the one that was started, or one of its workers.
    """

    def __init__(self, config: pytest.Config) -> None:
        path = config.getoption("noted")
        self._path = Path(path) if path else None
        self._worker: dict[str, object] | None = getattr(config, "workerinput", None)
        self._seconds: float = config.getoption("for_s")
        if self._worker is None:
            os.environ[BEGAN] = repr(time.time())
            self._before = self._read()
        else:
            self._before = set(self._worker["noted"])  # type: ignore[call-overload]
        self._ends = float(os.environ[BEGAN]) + self._seconds
        self._asked = 0
        self._passed = self._failed = 0

    def _read(self) -> set[str]:
        if self._path is None or not self._path.exists():
            return set()
        lines = self._path.read_text(encoding="utf-8").splitlines()
        return {line.partition(" ")[2] for line in lines}

    @pytest.hookimpl(optionalhook=True)
    def pytest_configure_node(self, node: object) -> None:
        """Tell a worker what was noted when the run began, so that all collect the same."""
        node.workerinput["noted"] = sorted(self._before)  # type: ignore[attr-defined]

    @pytest.hookimpl(trylast=True)  # of what the marks have left
    def pytest_collection_modifyitems(
        self, config: pytest.Config, items: list[pytest.Item]
    ) -> None:
        """Leave out what has passed before."""
        done = [item for item in items if item.nodeid in self._before]
        config.hook.pytest_deselected(items=done)
        items[:] = [item for item in items if item.nodeid not in self._before]

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_setup(self) -> None:
        """Begin nothing when the time is up."""
        if time.time() > self._ends:
            pytest.skip(f"{NO_TIME} {self._seconds:g}")

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Note what has passed, line by line: a run that is killed keeps what it has done."""
        if self._worker is not None:
            return
        if report.failed:
            self._failed += 1
        if report.when != "call" or not report.passed:
            self._asked += report.when == "setup" and report.skipped
            return
        self._passed += 1
        if self._path is not None:
            with self._path.open("a", encoding="utf-8") as file:
                file.write(f"{_commit()} {without_group(report.nodeid)}\n")

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """Say how far it has come."""
        if self._worker is None:
            terminalreporter.section("in parts")
            terminalreporter.line(
                f"{self._passed} passed, {self._failed} failed, {self._asked} left for another "
                f"run; {len(self._before)} had passed before"
            )


def _commit() -> str:
    """Return the commit that is tried, with a + where files were changed since."""
    if (git := shutil.which("git")) is None:
        return "no-commit"
    done = subprocess.run(
        [git, "describe", "--always", "--exclude=*", "--dirty=+"],
        cwd=Path(__file__).parent, capture_output=True, text=True, check=False,
    )  # fmt: skip
    return done.stdout.strip() or "no-commit"


def add_options(parser: pytest.Parser) -> None:
    """Let a run be asked for in parts."""
    group = parser.getgroup("parts", "runs that take hours")
    group.addoption("--noted", metavar="FILE", help="leave out what it says has passed, add to it")
    group.addoption(
        "--for", dest="for_s", type=float, default=float("inf"), metavar="SECONDS",
        help="begin no test later than that",
    )  # fmt: skip


def asked_for(config: pytest.Config) -> bool:
    """Whether a run is one in parts."""
    return bool(config.getoption("noted")) or config.getoption("for_s") < float("inf")
