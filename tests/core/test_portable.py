"""Sources hold nothing that only some systems have, but where the others have their own way."""

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from programs import ran

ROOT = Path(__file__).parents[2]
SOURCES = sorted(
    path for part in ("labcrane", "plugins") for path in (ROOT / part).rglob("*.py")
)  # fmt: skip

UNIX_MODULES = {
    "crypt", "fcntl", "grp", "posix", "pty", "pwd", "readline", "resource", "select", "syslog",
    "termios", "tty",
}  # fmt: skip
UNIX_NAMES = {
    "os": {
        "chown", "fchmod", "fchown", "fdatasync", "fork", "forkpty", "fstatvfs", "getegid",
        "geteuid", "getgid", "getloadavg", "getpgid", "getuid", "killpg", "mkfifo", "nice",
        "openpty", "posix_fadvise", "posix_fallocate", "pread", "pwrite", "sched_getaffinity",
        "sched_getscheduler", "sched_param", "sched_setaffinity", "sched_setscheduler", "setpgid",
        "setpriority", "setsid", "setuid", "statvfs", "sysconf", "uname", "wait", "wait3", "wait4",
        "O_CLOEXEC", "O_DIRECTORY", "O_NOFOLLOW", "O_NONBLOCK", "O_SYNC", "SCHED_FIFO",
        "SCHED_OTHER", "SCHED_RESET_ON_FORK", "SCHED_RR", "WEXITSTATUS", "WIFSIGNALED",
    },
    "signal": {
        "SIGALRM", "SIGCHLD", "SIGCONT", "SIGHUP", "SIGKILL", "SIGQUIT", "SIGSTOP", "SIGTSTP",
        "SIGUSR1", "SIGUSR2", "SIGXFSZ", "alarm", "pause", "pthread_kill", "setitimer",
    },
    "socket": {"AF_UNIX", "SO_REUSEPORT"},
    "tempfile": {"NamedTemporaryFile"},  # which a second process cannot open on Windows
    "time": {"CLOCK_MONOTONIC", "CLOCK_MONOTONIC_RAW", "clock_gettime"},
    "multiprocessing.connection": {"Connection"},  # elsewhere it is PipeConnection
}  # fmt: skip

TWINS = {
    "labcrane/analysis/parallel.py": ("os.sched_getaffinity",),  # elsewhere all cores there are
    "labcrane/cli/typed.py": ("select", "termios", "tty"),  # msvcrt, and a thread
    "labcrane/doctor/clock.py": (
        "time.CLOCK_MONOTONIC", "time.CLOCK_MONOTONIC_RAW", "time.clock_gettime",
    ),  # perf_counter: Windows slews no monotonic clock
    "labcrane/doctor/lsl.py": ("select",),  # of sockets, which every system can
    "labcrane/doctor/scheduling.py": (
        "os.geteuid", "os.sched_getaffinity", "resource",
    ),  # Linux's priorities; elsewhere nothing is said of them
    "labcrane/files/lock.py": ("fcntl",),  # msvcrt
    "labcrane/processes/real_time.py": (
        "os.SCHED_FIFO", "os.SCHED_OTHER", "os.SCHED_RESET_ON_FORK", "os.geteuid",
        "os.sched_getaffinity", "os.sched_param", "os.sched_setaffinity", "os.sched_setscheduler",
        "resource",
    ),  # MMCSS on Windows; elsewhere it is refused
    "labcrane/recording/annotations.py": ("os.geteuid",),  # Windows' folders have no such owner
    "labcrane/recording/participant_file/verification.py": (
        "os.posix_fadvise",
    ),  # elsewhere the memory's copy of a file is read
    "labcrane/streams/recorder/own_clock.py": (
        "time.CLOCK_MONOTONIC", "time.CLOCK_MONOTONIC_RAW", "time.clock_gettime",
    ),  # elsewhere there is no clock that nothing turns, and none is logged
    "labcrane/web/service.py": ("os.nice",),  # where there is none the page has the same priority
    "plugins/labcrane_joystick/kernel.py": ("fcntl", "os.O_NONBLOCK"),  # "not read" elsewhere
    "plugins/labcrane_ttl/parallel_port.py": ("fcntl",),  # serial_ttl and box_ttl
    "plugins/labcrane_sonification/real_time.py": (
        "os.SCHED_FIFO", "os.SCHED_OTHER", "os.SCHED_RESET_ON_FORK", "os.SCHED_RR",
        "os.sched_getscheduler", "os.sched_param", "os.sched_setscheduler",
    ),  # threads stay ordinary where there is no JACK
}  # fmt: skip
"""Modules that use what only some systems have, with what the others do there."""

BINARY_OPENERS = {"fdopen", "open", "NamedTemporaryFile", "TemporaryFile", "SpooledTemporaryFile"}
TEXT_METHODS = {"read_text": 0, "write_text": 1}
"""Methods of a path, and where their encoding is when it has no name."""

NO_FILES = {"webbrowser", "wave", "Image", "h5py", "os", "tarfile", "zipfile", "gzip"}
"""Whose ``open`` opens no text."""


def unix_names(source: str) -> set[str]:
    """Return what a source uses that not every system has."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names if alias.name in UNIX_MODULES}
        elif isinstance(node, ast.ImportFrom) and node.module:
            if node.module in UNIX_MODULES:
                found.add(node.module)
            known = UNIX_NAMES.get(node.module, set())
            found |= {f"{node.module}.{a.name}" for a in node.names if a.name in known}
        elif isinstance(node, ast.Attribute) and node.attr in UNIX_NAMES.get(
            ast.unparse(node.value), set()
        ):
            found.add(ast.unparse(node))
    return found


def texts_without_encoding(source: str) -> Iterator[int]:
    """Yield the lines in which a text file is opened, read or written in some encoding or other."""
    for node in ast.walk(ast.parse(source)):
        if not isinstance(node, ast.Call) or any(word.arg == "encoding" for word in node.keywords):
            continue
        called = node.func
        name = called.attr if isinstance(called, ast.Attribute) else getattr(called, "id", "")
        written = ast.unparse(called)
        in_text = {word.arg for word in node.keywords} & {"text", "universal_newlines"}
        if (
            (written.endswith(f".{name}") and len(node.args) <= TEXT_METHODS.get(name, -1))
            or (name in BINARY_OPENERS and opens_text(node))
            or (in_text and written.startswith("subprocess."))
        ):
            yield node.lineno


def opens_text(call: ast.Call) -> bool:
    owner = ast.unparse(call.func.value) if isinstance(call.func, ast.Attribute) else ""
    name = call.func.attr if isinstance(call.func, ast.Attribute) else ast.unparse(call.func)
    if name == "open" and owner.split(".")[0] in NO_FILES:
        return False
    of_a_path = name == "open" and bool(owner) and owner != "io"
    words = [word.value for word in call.keywords if word.arg == "mode"]
    places = call.args[0:1] if of_a_path else call.args[1:2]
    mode = [*words, *places]
    if not mode:  # ruff knows which of what has a method open is a path
        return name in {"open", "fdopen"} and not of_a_path
    return isinstance(mode[0], ast.Constant) and is_text(mode[0].value)


def is_text(mode: object) -> bool:
    return isinstance(mode, str) and set(mode) <= set("rwxat+") and "b" not in mode


@pytest.mark.slow
def test_what_not_every_system_has_is_used_only_where_the_others_have_their_own_way() -> None:
    used = {
        str(path.relative_to(ROOT)): tuple(sorted(names))
        for path in SOURCES
        if (names := unix_names(path.read_text(encoding="utf-8")))
    }
    assert used == {path: tuple(sorted(names)) for path, names in TWINS.items()}


@pytest.mark.slow
def test_no_text_is_read_or_written_in_the_encoding_of_the_country() -> None:
    found = [
        f"{path.relative_to(ROOT)}:{line}"
        for path in SOURCES
        for line in texts_without_encoding(path.read_text(encoding="utf-8"))
    ]
    assert found == []


def test_no_path_is_opened_in_the_encoding_of_the_country() -> None:
    # It is a rule on trial yet: chosen with the others, it would change what they say.
    rule = ["ruff", "check", "--preview", "--select", "PLW1514", "--output-format", "concise"]
    command = [sys.executable, "-m", *rule, "labcrane", "plugins", "benchmarks", "examples"]
    done = ran(command, cwd=ROOT)
    assert done.stdout == "All checks passed!\n"
