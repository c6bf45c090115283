"""What the gate notes of a run of tests: counts, times and figures, and what has passed.

A test that has passed in one stage of the gate is not run in the next one.
"""

import json
import os
import platform
from pathlib import Path

import pytest

GATE = "LABCRANE_GATE"
"""Names the file that the stages of a gate write their runs into; set by the gate alone."""

PASSED = "LABCRANE_PASSED"
"""Names the file of the tests that have passed in this gate: each passes once."""

QUICK = "not slow and not long and not soak"
"""What ``pytest`` runs without a word; pyproject.toml says so too."""

GROUPS = {
    QUICK: "quick tests",
    "not long and not soak": "quick and slow tests",
    "long": "long tests",
    "soak": "soak tests",
}
"""What the tests are called that the stages of a gate choose by their marks."""

LONG_FOR_QUICK_S = 3.0
"""Quick tests that take longer are listed; they fail nothing."""

QUICK_PROCESSOR_S = 420.0
"""What the quick tests may have of a processor before a run of them says so; it fails nothing."""


def leave_out_passed(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Take out of the collected tests those that have passed in an earlier stage of the gate."""
    path = Path(os.environ.pop(PASSED, ""))  # a pytest that a test starts has its own tests
    if not path.is_file():
        return
    passed = set(path.read_text(encoding="utf-8").splitlines())
    if left_out := [item for item in items if item.nodeid in passed]:
        config.hook.pytest_deselected(items=left_out)
        items[:] = [item for item in items if item.nodeid not in passed]


class Gate:
    """Notes counts, times and figures in a file.

    Parameters
    ----------
    config
        Of the process that was started, not of one of its workers.
    path
        A line of JSON is added to it for this run.
    passed
        Gets the names of the tests that pass; None keeps none.
    """

    def __init__(self, config: pytest.Config, path: Path, passed: Path | None = None) -> None:
        self._path = path
        self._passed = passed
        self._ended: set[str] = set()
        self._what = chosen(config)
        self._failed: set[str] = set()
        self._counts = {"passed": 0, "failed": 0, "skipped": 0}
        self._seconds: dict[str, float] = {}
        self._slow: set[str] = set()
        self._figures: dict[tuple[str, str], list[float]] = {}

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Count what ends, and keep what failed in any of its phases."""
        name = without_group(report.nodeid)
        self._seconds[name] = self._seconds.get(name, 0.0) + report.duration
        if {"slow", "long", "soak"} & set(report.keywords):
            self._slow.add(name)
        if report.when == "call" and {"long", "soak"} & set(report.keywords):
            for what, value in report.user_properties:
                values = value if isinstance(value, list) else [value]
                if all(isinstance(one, (int, float)) for one in values):
                    self._figures.setdefault((name.partition("[")[0], what), []).extend(values)
        if report.failed:
            self._counts["failed"] += name not in self._failed
            self._failed.add(name)
        elif report.skipped or report.when == "call":
            self._counts[report.outcome] += 1
            if report.passed:
                self._ended.add(name)

    @pytest.hookimpl(trylast=True)  # when the workers have ended
    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """Note how the run ended."""
        line = {
            "status": int(session.exitstatus),
            "system": platform.system(),
            "python": platform.python_version(),
            "what": self._what,
            **self._counts,
            "processor_s": round(_processor_s()),
            "figures": [
                {"test": test, "what": what, "values": len(found), "largest": max(found, default=0)}
                for (test, what), found in self._figures.items()
            ],
        }
        with self._path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(line) + "\n")
        if self._passed is not None:
            with self._passed.open("a", encoding="utf-8") as file:
                file.writelines(f"{name}\n" for name in sorted(self._ended - self._failed))

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """End with quick tests that are not quick, and the processor's time."""
        terminalreporter.section("the gate")
        long = {
            name: seconds
            for name, seconds in self._seconds.items()
            if seconds > LONG_FOR_QUICK_S and name not in self._slow
        }
        for name, seconds in sorted(long.items(), key=lambda pair: -pair[1]):
            terminalreporter.line(f"{seconds:6.1f} s for a quick test: {name}")
        used = _processor_s()
        most = QUICK_PROCESSOR_S if terminalreporter.config.getoption("markexpr") == QUICK else used
        more = f": more than the {most:.0f} s of quick tests" if used > most else ""
        terminalreporter.line(f"{used:.0f} s of processor{more}")


def without_group(nodeid: str) -> str:
    """Return a test's name without the group that xdist appends; a parameter may have an @, too."""
    name, at, group = nodeid.rpartition("@")
    return nodeid if not at or group.endswith("]") else name


def chosen(config: pytest.Config) -> str:
    """Return in words which tests are run."""
    marks = config.getoption("markexpr")
    group = GROUPS.get(marks, f"tests that are {marks}" if marks else "all tests")
    places = config.getoption("file_or_dir")
    return f"{group} of {', '.join(places)}" if places else group


def _processor_s() -> float:
    """Return the seconds of processor of this process and of all that it has waited for."""
    import resource  # Windows has none, and no gate

    return sum(
        used.ru_utime + used.ru_stime
        for used in map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    )
