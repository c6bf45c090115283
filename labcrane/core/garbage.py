"""Garbage: objects that hold each other, found by looking through all that there are."""

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock

_SETTLED = Lock()
"""Held while what was there is left out."""


@contextmanager
def settled() -> Iterator[None]:
    """Leave what is there already out of every search.

    It is as much as everything else that a search looks through, and one takes many ticks' time.
    Where it is left out already, that is all.
    """
    if not _SETTLED.acquire(blocking=False):
        yield
        return
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()
        _SETTLED.release()


@contextmanager
def cleared() -> Iterator[None]:
    """Leave no garbage behind: search once at the end, in what was made meanwhile alone.

    Python searches among the old when there is a quarter more of them, and arrays do not count. Of
    hundreds of sessions' logs megabytes would wait.
    """
    with settled():
        try:
            yield
        finally:
            gc.collect()
