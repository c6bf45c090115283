"""Runs that take hours, in parts: what has passed is noted and not run again, and time is bounded.

``pytest -m soak tests/faults/test_kills.py -n 8 --noted=kills.txt --for 1200`` begins only tests
whose timeout ends within 1,200 s, those with the longest first. It writes what passes into
``kills.txt`` with the commit it passed on, and ends by saying how much of all is done; the same
command again goes on from there. What fails is never noted: it is run again. What passes while
files differ from the commit is not noted. When all has passed, the file is renamed to
``kills.txt.complete``, so that the next run tries everything anew.

The sign = is needed where the file is in another project: pytest takes a word that is the path of a
file for one of tests, and would look for its settings there.
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

NAME = "parts"
"""Of the plugin; ``second_try`` asks it how much of all is done."""

NO_TIME = "no time is left for it: --for"
CHANGED = "+"
"""Ends the commit of files that were changed since."""


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
        self._output: dict[str, object] = getattr(config, "workeroutput", {})
        self._seconds: float = config.getoption("for_s")
        if self._worker is None:
            os.environ[BEGAN] = repr(time.time())
            self._before = self._read()
        else:
            self._before = dict.fromkeys(self._worker["noted"], "")  # type: ignore[call-overload]
        self._ends = float(os.environ[BEGAN]) + self._seconds
        self._commit = _commit() if self._worker is None else ""
        self._left_out: set[str] = set()
        self._collected = 0
        self._no_time = self._passed = self._failed = 0

    def _read(self) -> dict[str, str]:
        if self._path is None or not self._path.exists():
            return {}
        lines = (
            line.partition(" ") for line in self._path.read_text(encoding="utf-8").splitlines()
        )
        return {name: commit for commit, _, name in lines if not commit.endswith(CHANGED)}

    def so_far(self) -> dict[str, object]:
        """Return how many of all tests have passed, now and before, and of which commits."""
        commits = {commit: None for name, commit in self._before.items() if name in self._left_out}
        return {
            "before": len(self._left_out),
            "passed": len(self._left_out) + self._passed,
            "no_time": self._no_time,
            "of": len(self._left_out) + self._collected,
            "commits": list(commits | ({self._commit: None} if self._passed else {})),
        }

    @pytest.hookimpl(optionalhook=True)
    def pytest_configure_node(self, node: object) -> None:
        """Tell a worker what was noted when the run began, so that all collect the same."""
        node.workerinput["noted"] = sorted(self._before)  # type: ignore[attr-defined]

    @pytest.hookimpl(optionalhook=True)
    def pytest_xdist_node_collection_finished(self, ids: list[str]) -> None:
        """Count what a worker has collected: each has the same."""
        self._collected = len(ids)

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node: object) -> None:
        """Hear from a worker what it has left out."""
        self._left_out |= set(getattr(node, "workeroutput", {}).get("left_out", ()))

    @pytest.hookimpl(trylast=True)  # of what the marks have left
    def pytest_collection_modifyitems(
        self, config: pytest.Config, items: list[pytest.Item]
    ) -> None:
        """Leave out what has passed before, and begin with what may take longest."""
        done = [item for item in items if without_group(item.nodeid) in self._before]
        config.hook.pytest_deselected(items=done)
        items[:] = [item for item in items if without_group(item.nodeid) not in self._before]
        items.sort(key=_timeout, reverse=True)
        self._collected = len(items)
        self._left_out = {without_group(item.nodeid) for item in done}
        self._output["left_out"] = sorted(self._left_out)

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_setup(self, item: pytest.Item) -> None:
        """Begin only what ends in time, even if it takes as long as it may."""
        if (timeout := _timeout(item)) >= self._seconds:
            reason = f"it may take {timeout:g} s, which --for {self._seconds:g} never leaves for it"
            pytest.fail(reason, pytrace=False)
        if time.time() + timeout > self._ends:
            pytest.skip(f"{NO_TIME} {self._seconds:g}")

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Note what has passed, line by line: a run that is killed keeps what it has done."""
        if self._worker is not None:
            return
        if report.failed:
            self._failed += 1
        if report.when != "call" or not report.passed:
            self._no_time += report.when == "setup" and NO_TIME in str(report.longrepr)
            return
        self._passed += 1
        if self._path is not None and not self._commit.endswith(CHANGED):
            with self._path.open("a", encoding="utf-8") as file:
                file.write(f"{self._commit} {without_group(report.nodeid)}\n")

    @pytest.hookimpl(tryfirst=True)  # before the gate notes how the run ended
    def pytest_sessionfinish(self, session: pytest.Session, exitstatus: int) -> None:
        """End well where all has passed, even if all of it had passed before."""
        if self._worker is not None or self._path is None or not self._path.exists():
            return
        if self._left_out and exitstatus == pytest.ExitCode.NO_TESTS_COLLECTED:
            session.exitstatus = pytest.ExitCode.OK
        if self._passed == self._collected:
            self._path.replace(f"{self._path}.complete")

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """Say how far it has come."""
        if self._worker is not None:
            return
        terminalreporter.section("in parts")
        so_far = self.so_far()
        terminalreporter.line(
            f"{so_far['passed']} of {so_far['of']} have passed, {so_far['before']} of them before; "
            f"{self._failed} failed; {self._no_time} are left for another run"
        )
        if self._path is not None and self._commit.endswith(CHANGED):
            terminalreporter.line("nothing is noted: files were changed since the last commit")


def _timeout(item: pytest.Item) -> float:
    """Return how long a test may take, in s; 0 where there is no limit."""
    mark = item.get_closest_marker("timeout")
    return float(mark.args[0] if mark else item.config.getini("timeout") or 0.0)


def _commit() -> str:
    """Return the commit that is tried, ending with ``CHANGED`` where files were changed since."""
    if (git := shutil.which("git")) is None:
        return "no-commit"
    done = subprocess.run(
        [git, "describe", "--always", "--exclude=*", f"--dirty={CHANGED}"],
        cwd=Path(__file__).parent, capture_output=True, text=True, check=False,
    )  # fmt: skip
    return done.stdout.strip() or "no-commit"


def add_options(parser: pytest.Parser) -> None:
    """Let a run be asked for in parts."""
    group = parser.getgroup("parts", "runs that take hours")
    group.addoption("--noted", metavar="FILE", help="leave out what it says has passed, add to it")
    group.addoption(
        "--for", dest="for_s", type=float, default=float("inf"), metavar="SECONDS",
        help="begin no test that may end later than that",
    )  # fmt: skip


def asked_for(config: pytest.Config) -> bool:
    """Whether a run is one in parts."""
    return bool(config.getoption("noted")) or config.getoption("for_s") < float("inf")
