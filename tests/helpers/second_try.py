"""A second try for tests that failed in the gate, and what the gate says of a run.

A test that has passed in one stage of the gate is not run in the next one. A computer that does
other work can make a right test fail. So the gate runs what failed once more, alone, when
everything else has ended. What passes then is named, and its run is green; a test that fails twice,
or more than ``MOST`` that fail once, is red. ``pytest`` by itself gives no second try.
"""

import json
import os
import platform
import subprocess
import sys
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

MOST = 3
"""How many tests of one gate may need a second try; those of a fixture that failed count as one."""

LONG_FOR_QUICK_S = 3.0
"""Quick tests that take longer are listed; they fail nothing."""

QUICK_PROCESSOR_S = 420.0
"""What the quick tests may have of a processor before a run of them says so; it fails nothing."""

LASTS_S = 1200.0
"""How long the second tries may take together."""


def leave_out_passed(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Take out of the collected tests those that have passed in an earlier stage of the gate."""
    path = Path(os.environ.pop(PASSED, ""))  # a pytest that a test starts has its own tests
    if not path.is_file():
        return
    passed = set(path.read_text(encoding="utf-8").splitlines())
    if left_out := [item for item in items if item.nodeid in passed]:
        config.hook.pytest_deselected(items=left_out)
        items[:] = [item for item in items if item.nodeid not in passed]


class SecondTry:
    """Tries once more what failed, and notes counts, times, figures and second tries in a file.

    Parameters
    ----------
    config
        Of the process that was started, not of one of its workers.
    path
        A line of JSON is added to it for this run; the lines of the same gate count together.
    passed
        Gets the names of the tests that pass; None keeps none.
    """

    def __init__(self, config: pytest.Config, path: Path, passed: Path | None = None) -> None:
        self._config = config
        self._path = path
        self._passed = passed
        self._ended: set[str] = set()
        self._what = chosen(config)
        self._failed: dict[str, object] = {}
        self._counts = {"passed": 0, "failed": 0, "skipped": 0}
        self._seconds: dict[str, float] = {}
        self._slow: set[str] = set()
        self._figures: dict[tuple[str, str], list[float]] = {}
        self._again: list[str] = []
        self._says: list[str] = []

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
            self._failed.setdefault(name, _cause(report))
        elif report.skipped or report.when == "call":
            self._counts[report.outcome] += 1
            if report.passed:
                self._ended.add(name)

    @pytest.hookimpl(trylast=True)  # when the workers have ended
    def pytest_sessionfinish(self, session: pytest.Session, exitstatus: int) -> None:
        """Run what failed alone; the run is green when all of it passes."""
        tried = sum(line.get("faults", 0) for line in self._lines())  # a command's line has none
        in_parts = self._config.pluginmanager.has_plugin("parts")  # the next part tries it again
        if exitstatus == pytest.ExitCode.TESTS_FAILED and self._failed and not in_parts:
            if (faults := tried + self._faults()) > MOST:
                self._says.append(f"no second try: {faults} tests failed in this gate, {MOST} may")
            elif _passes(list(self._failed), self._config.rootpath):
                self._again = list(self._failed)
                session.exitstatus = pytest.ExitCode.OK
            else:
                self._says.append("failed twice: " + ", ".join(self._failed))
        if self._again:
            self._says.append("needed a second try: " + ", ".join(self._again))
        self._note(int(session.exitstatus))

    def _faults(self) -> int:
        """Return how many tests failed; those of one fixture that failed are one."""
        return len(set(self._failed.values()))

    def _lines(self) -> list[dict[str, int]]:
        if not self._path.exists():
            return []
        return [json.loads(line) for line in self._path.read_text(encoding="utf-8").splitlines()]

    def _note(self, status: int) -> None:
        parts = self._config.pluginmanager.get_plugin("parts")
        so_far = parts.so_far() if parts else {}
        if so_far:
            self._counts["passed"] += so_far["before"]
            self._counts["skipped"] -= so_far["no_time"]
        line = {
            "status": status,
            "system": platform.system(),
            "python": platform.python_version(),
            "what": self._what,
            **self._counts,
            "second_try": self._again,
            "faults": self._faults() if self._again else 0,
            "processor_s": round(_processor_s()),
            "figures": [
                {"test": test, "what": what, "values": len(found), "largest": max(found, default=0)}
                for (test, what), found in self._figures.items()
            ],
            "parts": so_far,
        }
        with self._path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(line) + "\n")
        if self._passed is not None:
            with self._passed.open("a", encoding="utf-8") as file:
                file.writelines(f"{name}\n" for name in sorted(self._ended - set(self._failed)))

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """End with quick tests that are not quick, the processor's time, and second tries."""
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
        for says in self._says:
            terminalreporter.line(says)


def _cause(report: pytest.TestReport) -> object:
    """Return what made a test fail: a fixture of its file that all its tests share, or itself."""
    file, _, test = report.nodeid.partition("::")
    where = getattr(report.longrepr, "reprcrash", None)
    if report.when == "setup" and where is not None:
        return file, where.path, where.lineno, where.message
    return file, test


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


def _passes(names: list[str], root: Path) -> bool:
    """Whether tests pass when they are run one after the other, with nothing beside them."""
    words = ["-n", "0", "-m", "", "-q", "-p", "no:cacheprovider", *names]
    environment = {name: value for name, value in os.environ.items() if name != "PYTEST_ADDOPTS"}
    try:
        done = subprocess.run(
            [sys.executable, "-m", "pytest", *words],
            cwd=root, env=environment, timeout=LASTS_S, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return False
    return done.returncode == 0


def _processor_s() -> float:
    """Return the seconds of processor of this process and of all that it has waited for."""
    import resource  # Windows has none, and no gate

    return sum(
        used.ru_utime + used.ru_stime
        for used in map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    )
