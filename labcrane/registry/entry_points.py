"""The entry points of what is installed in folders, read from the files that pip leaves there.

``importlib.metadata`` finds the same, but looks at everything that is installed, which takes longer
than importing the plugins that a protocol names.
"""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

PROJECT = "labcrane"
"""The group of plugins; groups below it say more of them: ``labcrane.commands``."""


class Declared(NamedTuple):
    """A line of a package's entry points: ``[group]``, and below it ``name = value``."""

    group: str
    name: str
    value: str


def declared() -> Iterator[Declared]:
    """Yield the entry points in the group of plugins, and in those below it.

    Of a package that is found twice, the first on the path counts, as it does for imports.
    """
    packages: set[str] = set()
    for folder in dict.fromkeys(sys.path):
        for path in sorted(Path(folder).glob("*.*-info/entry_points.txt")):
            package = path.parent.stem.partition("-")[0].lower()
            if package not in packages:
                packages.add(package)
                text = path.read_text(encoding="utf-8")
                yield from _lines(text) if PROJECT in text else ()


def _lines(text: str) -> Iterator[Declared]:
    group = ""
    for line in map(str.strip, text.splitlines()):
        if line.startswith("["):
            group = line.strip("[] ")
        elif f"{group}.".startswith(f"{PROJECT}.") and line and not line.startswith(("#", ";")):
            name, _, value = map(str.strip, line.partition("="))
            yield Declared(group, name, value)
