"""Screen examination: whether a session can keep it from going blank."""

from collections.abc import Iterator

from labcrane.core.findings import Finding, Verdict
from labcrane.processes.wake_lock import wake_lock

ADVICE = "switch off blanking, locking and sleep in the desktop's settings for study days"


def examine() -> Iterator[Finding]:
    """Keep the screen awake as a session does, and report which service does it."""
    with wake_lock() as lock:
        if lock.held_by:
            text = f"a session keeps the screen awake by {', '.join(lock.held_by)}"
            yield Finding(Verdict.PASS, text)
            return
    asked = ", ".join(each.partition(":")[0] for each in lock.failed) or "no service"
    text = (
        f"the screen may go blank or lock during a session: nothing keeps it awake (asked: {asked})"
    )
    yield Finding(Verdict.WARN, text, ADVICE)
