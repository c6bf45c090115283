"""Entry points of whatever is installed, read once: every distribution's file is opened for it."""

import sys
from functools import lru_cache
from importlib.metadata import EntryPoints, entry_points
from typing import Any


def entry_points_of(group: str) -> EntryPoints:
    """Return the entry points of a group, of all that can be imported now from ``sys.path``."""
    found: EntryPoints = _all(tuple(sys.path)).select(group=group)
    return found


@lru_cache(maxsize=1)
def _all(path: tuple[str, ...]) -> Any:  # SelectableGroups before Python 3.12, EntryPoints since
    return entry_points()
