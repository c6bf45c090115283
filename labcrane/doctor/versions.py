"""Versions of labcrane and of what it stands on: the lines that a bug report needs."""

import platform
import sys
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, entry_points, version
from pathlib import Path

from labcrane.registry.hookspecs import PROJECT

LIBRARIES = (
    "numpy", "scipy", "pandas", "h5py", "pydantic", "pylsl", "panda3d", "mujoco", "pybullet", "pyo",
    "pygame", "python-can", "nicegui", "typer",
)  # fmt: skip
"""Distributions whose version has explained a fault before."""


def versions() -> Sequence[str]:
    """Return a line each for labcrane, Python, the computer, libraries and plugins."""
    package = Path(__file__).parents[1]
    libraries = ", ".join(f"{name} {_version(name)}" for name in LIBRARIES)
    others = sorted(
        {
            f"{point.dist.name} {point.dist.version}"
            for point in entry_points(group=PROJECT)
            if point.dist is not None and point.dist.name != PROJECT
        }
    )
    return (
        f"labcrane {_version(PROJECT)} in {package}",
        f"Python {platform.python_version()} ({sys.executable})",
        f"computer: {platform.platform()}, {platform.machine()}, {_system()}",
        f"libraries: {libraries}",
        f"plugins of others: {', '.join(others) or 'none'}",
    )


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
