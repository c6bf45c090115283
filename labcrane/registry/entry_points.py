"""Entry points of whatever is installed in folders, read once and without ``importlib.metadata``.

Every command asks for them, and what the standard library needs to read them (the parser of mail)
takes a fifth of the time in which the help is printed.
"""

import os
import re
import sys
from collections.abc import Iterator
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from importlib.metadata import Distribution

INFORMATION = (".dist-info", ".egg-info")
"""Endings of folders with a distribution's metadata."""

LISTED = "entry_points.txt"
"""File of a distribution's entry points, in sections named by group."""


class EntryPoint(NamedTuple):
    """An entry point as a line of a distribution's file says it."""

    name: str
    value: str
    group: str
    folder: Path

    @property
    def module(self) -> str:
        """The module that it names."""
        return self.value.partition(":")[0].strip()

    @property
    def dist(self) -> "Distribution | None":
        """The distribution that offers it; points of the standard library may have none."""
        from importlib.metadata import Distribution  # noqa: PLC0415 - what this module spares

        return Distribution.at(self.folder)

    def load(self) -> Any:
        """Import the module, and return what it is asked for: itself, or something inside it."""
        found: Any = import_module(self.module)
        inside = self.value.partition("[")[0].partition(":")[2].strip()
        for name in filter(None, inside.split(".")):
            found = getattr(found, name)
        return found


def entry_points_of(group: str) -> tuple[EntryPoint, ...]:
    """Return the entry points of a group, of all that can be imported now from ``sys.path``."""
    return tuple(each for each in _all(tuple(sys.path)) if each.group == group)


@lru_cache(maxsize=1)
def _all(path: tuple[str, ...]) -> tuple[EntryPoint, ...]:
    """Return those of the first distribution of each name: only that can be imported."""
    first: dict[str, Path] = {}
    for folder in (folder for place in path for folder in _information(place)):
        first.setdefault(one_name(folder.name.partition("-")[0]), folder)
    return tuple(point for folder in first.values() for point in _points(folder))


def one_name(project: str) -> str:
    """Return the one way to write a project's name, by PEP 503."""
    return re.sub(r"[-_.]+", "-", project).lower()


def _information(place: str) -> Iterator[Path]:
    try:
        with os.scandir(place or ".") as inside:
            found = [each.name for each in inside if each.name.lower().endswith(INFORMATION)]
    except OSError:  # the path may name what is not there, or must not be read: nothing comes of it
        return
    yield from (Path(place, name) for name in found)


def _points(folder: Path) -> Iterator[EntryPoint]:
    try:
        lines = (folder / LISTED).read_text(encoding="utf-8").splitlines()
    except OSError:  # most distributions offer nothing
        return
    group = ""
    for line in map(str.strip, lines):
        if line.startswith("[") and line.endswith("]"):
            group = line[1:-1]
        elif line and not line.startswith("#"):
            name, _, value = line.partition("=")
            yield EntryPoint(name.strip(), value.strip(), group, folder)
