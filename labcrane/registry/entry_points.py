"""Entry points of whatever is installed, read once: every distribution's file is opened for it."""

import sys
from functools import lru_cache
from importlib.metadata import EntryPoints, entry_points


def entry_points_of(group: str) -> EntryPoints:
    """Return the entry points of a group, of all that can be imported now from ``sys.path``."""
    return _all(tuple(sys.path)).select(group=group)


@lru_cache(maxsize=1)
def _all(path: tuple[str, ...]) -> EntryPoints:
    return entry_points()
