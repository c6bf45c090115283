"""Versions of labcrane and its dependencies: the lines that a bug report needs."""

import os
import platform
import shutil
import subprocess
import sys
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from labcrane.registry.entry_points import entry_points_of
from labcrane.registry.hookspecs import PROJECT
from labcrane.streams.network import VARIABLE

LIBRARIES = (
    "numpy", "scipy", "pandas", "h5py", "pydantic", "pylsl", "panda3d", "mujoco", "pybullet", "pyo",
    "pygame", "python-can", "nicegui", "typer",
)  # fmt: skip
"""Distributions whose version has explained a fault before."""

GIT_S = 5.0
"""Time limit of git's answer on the commit."""


def versions() -> Sequence[str]:
    """Return a line each for labcrane, Python, the computer, libraries and plugins."""
    package = Path(__file__).parents[1]
    others = sorted(
        {
            f"{point.dist.name} {point.dist.version}"
            for point in entry_points_of(PROJECT)
            if point.dist is not None and point.dist.name != PROJECT
        }
    )
    return (
        f"labcrane {_version(PROJECT)} in {package}{commit(package.parent)}",
        f"Python {platform.python_version()} ({sys.executable})",
        f"computer: {platform.platform()}, {platform.machine()}, {_system()}",
        f"libraries: {', '.join(libraries())}",
        f"{liblsl()}; {configuration()}",
        f"third-party plugins: {', '.join(others) or 'none'}",
    )


def libraries() -> list[str]:
    """Return the version of each library, as its distribution has it."""
    return [f"{name} {_version(name)}" for name in LIBRARIES]


def commit(root: Path) -> str:
    """Return a clone's commit, and whether files are changed; empty if it is not a clone."""
    if not (root / ".git").exists():  # a folder, or a file in a further working tree
        return ""
    if (git := shutil.which("git")) is None:
        return ", a clone; its commit is unknown, since git is not installed"
    command = [
        git,
        "-C",
        str(root),
        "describe",
        "--always",
        "--dirty",
        "--abbrev=12",
        "--exclude=*",
    ]
    try:
        done = subprocess.run(  # noqa: S603 - git itself
            command, check=False, capture_output=True, encoding="utf-8", timeout=GIT_S
        )
    except subprocess.TimeoutExpired:
        return f", a clone; its commit is unknown, since git did not answer within {GIT_S:g} s"
    if done.returncode:
        return f", a clone; its commit is unknown ({done.stderr.strip()})"
    return f", commit {done.stdout.strip()}"


def liblsl() -> str:
    """Return the version of the library below pylsl, which is not pylsl's own."""
    try:
        import pylsl  # noqa: PLC0415 - not in every installation
    except ModuleNotFoundError:
        return "liblsl: not installed"
    except Exception as error:  # noqa: BLE001 - pylsl raises RuntimeError where it finds no liblsl
        return f"liblsl: cannot be loaded ({error})"
    number = pylsl.library_version()
    return f"liblsl {number // 100}.{number % 100} ({pylsl.library_info()})"


def configuration() -> str:
    """Return which configuration file liblsl is given, and whether it exists."""
    if not (name := os.environ.get(VARIABLE)):
        return f"{VARIABLE} is not set, liblsl looks for lsl_api.cfg itself"
    return f"{VARIABLE} is {name}{'' if Path(name).is_file() else ', which does not exist'}"


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"


def _system() -> str:
    try:
        return platform.freedesktop_os_release()["PRETTY_NAME"]
    except (OSError, KeyError):  # Windows, macOS
        return platform.system()
