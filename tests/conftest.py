"""LSL on this computer only, apart from any other test run, before anything imports pylsl.

Tests run in several processes at once, each with an LSL session of its own, and take what they need
of the computer in turn: see ``needs`` and ``pytest_runtest_protocol``.
"""

import atexit
import os
import shutil
import signal
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from gate import GATE, PASSED, QUICK, Gate, leave_out_passed
from hypothesis import HealthCheck, settings
from leavings import watch
from left_out import leave_out, look_again, nothing_to_find
from needs import need, not_tried
from once import RUN_FOLDER
from port_block import claim

from labcrane.streams.network import LOOPBACK
from labcrane.testing import Registry, discover

_FOLDER = Path(tempfile.mkdtemp(prefix="labcrane-tests-"))
atexit.register(shutil.rmtree, _FOLDER, ignore_errors=True)
_CONFIG = _FOLDER / "lsl_api.cfg"
# Ports of their own, not only a session: when a source is gone, liblsl takes any stream that looks
# like it, of whatever session (see labcrane.streams.recorder.recorder).
_FIRST_PORT, _HOLDER = claim()
atexit.register(_HOLDER.close)
_CONFIG.write_text(
    LOOPBACK.replace("[lab]", f"[lab]\nSessionID = labcrane-tests-{os.getpid()}").replace(
        "[ports]", f"[ports]\nMulticastPort = {_FIRST_PORT}\nBasePort = {_FIRST_PORT + 1}"
    ),
    encoding="utf-8",
)
os.environ["LSLAPICFG"] = str(_CONFIG)
# One thread each: the processes would take the cores from each other.
for _library in ("OMP", "OPENBLAS", "MKL"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")

# Tests start over a thousand Python processes: what they import is compiled once.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# What a shell starts in the background ignores interrupts, and so does all that it starts itself:
# tests interrupt programs as a person does.
signal.signal(signal.SIGINT, signal.default_int_handler)

# How long an example takes is the computer's doing, where several processes share two cores.
settings.register_profile(
    "tests", settings(), deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("tests")


@pytest.fixture(scope="module")
def registry() -> Registry:
    """What is installed."""
    return discover()


@pytest.fixture
def table() -> Iterator[object]:
    """A desk at which sticks can be plugged in."""
    from virtual_sticks import desk

    with desk() as table:
        yield table


WAITING = 2
"""Processes beyond one a core: many tests wait, for a session in real time or for a device.

Of the quick tests fewer do, and each process imports and collects all of them: they have one less.
"""


LONG_S = 1800
"""How long a test marked ``long`` may take, in s: busy computers need a multiple of the minutes."""


def pytest_configure(config: pytest.Config) -> None:
    if not hasattr(config, "workerinput"):
        os.environ[RUN_FOLDER] = str(_FOLDER)
        if sys.platform != "win32":
            watch()
    if GATE in os.environ and not hasattr(config, "workerinput"):
        passed = Path(os.environ[PASSED]) if PASSED in os.environ else None
        config.pluginmanager.register(Gate(config, Path(os.environ.pop(GATE)), passed))


@pytest.hookimpl(optionalhook=True)  # pytest -p no:xdist
def pytest_xdist_auto_num_workers(config: pytest.Config) -> int:
    """Return how many processes ``-n auto`` starts."""
    if sys.platform == "win32":
        return os.cpu_count() or 1
    quick = config.getoption("markexpr") == QUICK
    return len(os.sched_getaffinity(0)) + WAITING - quick


def pytest_collection() -> None:
    nothing_to_find()


def pytest_collection_finish() -> None:
    leave_out()


def pytest_sessionfinish() -> None:
    look_again()


@pytest.hookimpl(tryfirst=True)  # before xdist reads the marks
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Keep the tests of a file in one process, which makes their fixtures once."""
    leave_out_passed(config, items)
    for item in items:
        if item.get_closest_marker("long") and not item.get_closest_marker("timeout"):
            item.add_marker(pytest.mark.timeout(LONG_S))
        if item.get_closest_marker("xdist_group") is None and _shares(item):
            item.add_marker(pytest.mark.xdist_group(item.nodeid.partition("::")[0]))


def _shares(item: pytest.Item) -> bool:
    """Whether a test has a fixture that others of its file have too."""
    fixtures = getattr(item, "_fixtureinfo", None)
    if fixtures is None:
        return False
    made = (one for found in fixtures.name2fixturedefs.values() for one in found)
    return any(one.scope in {"module", "class"} for one in made)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Let a test that is ``quiet`` run while no other process of this run has one."""
    quiet = item.get_closest_marker("quiet") is not None
    with _turn(alone=quiet):
        return (yield)


@contextmanager
def _turn(*, alone: bool) -> Iterator[None]:
    if sys.platform == "win32":  # its locks are not shared; such tests are Unix's, or by themselves
        yield
        return
    import fcntl

    folder = Path(os.environ[RUN_FOLDER])
    with (
        (folder / "queue").open("w", encoding="utf-8") as queue,
        (folder / "computer").open("w", encoding="utf-8") as computer,
    ):
        # Whoever wants the computer alone waits in the queue; nobody overtakes.
        fcntl.flock(queue, fcntl.LOCK_EX)
        fcntl.flock(computer, fcntl.LOCK_EX if alone else fcntl.LOCK_SH)
        fcntl.flock(queue, fcntl.LOCK_UN)
        yield


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    for mark in item.iter_markers("needs"):
        need(*mark.args)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """End by saying what was not tried, and why."""
    skipped = terminalreporter.stats.get("skipped", [])
    reasons = [one.longrepr[2] for one in skipped if isinstance(one.longrepr, tuple)]
    lines = not_tried(reasons)
    if terminalreporter.config.getoption("markexpr") == QUICK:
        lines.append(
            "the quick tests were run; pytest -m slow takes ten minutes, "
            "pytest -m long half an hour, pytest -m soak hours"
        )
    if lines:
        terminalreporter.section("not tried on this computer")
        for line in lines:
            terminalreporter.line(line)
