"""Wake lock: keeps the screen awake, since joysticks do not reset a desktop's idle timer.

wakepy asks the desktop over D-Bus, macOS by ``caffeinate`` and Windows by
``SetThreadExecutionState``; each ends with our process, however that ends. Not tried on a desktop,
a Mac or Windows.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class WakeLock:
    """Services that keep the screen awake, in words for the record.

    Attributes
    ----------
    held_by
        Services that hold it; none where the screen may blank or lock.
    failed
        What was asked and did not, each with why.
    """

    held_by: tuple[str, ...] = ()
    failed: tuple[str, ...] = ()


@contextmanager
def wake_lock() -> Iterator[WakeLock]:
    """Keep the screen awake while the block lasts, as far as the system lets us."""
    from wakepy import keep  # noqa: PLC0415 - loads for a tenth of a second

    with keep.presenting(on_fail="pass") as mode:
        asked = mode.result.list_methods()
        yield WakeLock(
            tuple(each.method_name for each in asked if each.success),
            tuple(
                f"{each.method_name}: {each.failure_reason}"
                for each in asked
                if each.success is False
            ),
        )
