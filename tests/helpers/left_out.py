"""Objects that every search for garbage leaves out: all that the tests' modules brought.

They are half a million and stay for as long as a process runs tests. A search through them takes a
third of a second: one a session would be a quarter of a run's time.
"""

import gc
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

from labcrane.core.garbage import settled

_LEFT_OUT = ExitStack()


def nothing_to_find() -> None:
    """Look for no garbage, until ``leave_out``: what is imported stays."""
    gc.disable()


def leave_out() -> None:
    """Leave out what is there; sessions do the same, so they find it done."""
    gc.enable()
    _LEFT_OUT.enter_context(settled())


def look_again() -> None:
    """Look through everything again."""
    gc.enable()
    _LEFT_OUT.close()


@contextmanager
def as_in_a_program() -> Iterator[None]:
    """Leave nothing out but what the code itself leaves out."""
    _LEFT_OUT.close()
    try:
        yield
    finally:
        leave_out()
