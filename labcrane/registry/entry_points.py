"""Entry points of whatever is installed, read once and without ``importlib.metadata``.

Every command asks for them, and what the standard library needs to read them (the parser of mail)
takes a fifth of the time in which the help is printed. Where something else than folders offers
packages (a zip on the path, a finder of its own), the standard library is asked.
"""

import os
import re
import sys
from collections.abc import Iterable, Iterator
from functools import lru_cache
from importlib import import_module
from importlib.machinery import PathFinder
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

if TYPE_CHECKING:
    from importlib.metadata import Distribution

INFORMATION = (".dist-info", ".egg-info")
"""Endings of folders with a distribution's metadata."""

LISTED = "entry_points.txt"
"""File of a distribution's entry points, in sections named by group."""


class EntryPoint(Protocol):
    """A name under which a distribution offers a module or an object, as the library's own are."""

    @property
    def name(self) -> str: ...

    @property
    def value(self) -> str: ...

    @property
    def module(self) -> str: ...

    @property
    def dist(self) -> Any: ...

    def load(self) -> Any: ...


class ListedPoint(NamedTuple):
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
    def dist(self) -> "Distribution":
        """The distribution that offers it."""
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
    return tuple(each for where, each in _all(tuple(sys.path)) if where == group)


@lru_cache(maxsize=1)
def _all(path: tuple[str, ...]) -> tuple[tuple[str, EntryPoint], ...]:
    others = [each for each in sys.meta_path if each is not PathFinder]
    packed = [place for place in path if Path(place).is_file()]
    if packed or any(hasattr(each, "find_distributions") for each in others):
        from importlib.metadata import distributions  # noqa: PLC0415 - what this module spares

        return _first_of_each(
            (_name(each), [(point.group, point) for point in each.entry_points])
            for each in distributions()
        )
    return _first_of_each(
        (folder.name.partition("-")[0], [(point.group, point) for point in _points(folder)])
        for place in path
        for folder in _information(place)
    )


def _name(found: "Distribution") -> str:
    """Return a distribution's name; empty for remains of an installer."""
    try:
        return found.metadata["Name"] or ""
    except FileNotFoundError:  # as later libraries say it
        return ""


def _first_of_each(
    found: Iterable[tuple[str, list[tuple[str, EntryPoint]]]],
) -> tuple[tuple[str, EntryPoint], ...]:
    """Return the entry points of the first distribution of each name: only that can be imported."""
    first: dict[str, list[tuple[str, EntryPoint]]] = {}
    for name, points in found:
        first.setdefault(one_name(name), points)
    return tuple(point for points in first.values() for point in points)


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


def _points(folder: Path) -> Iterator[ListedPoint]:
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
            yield ListedPoint(name.strip(), value.strip(), group, folder)
