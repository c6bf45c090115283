"""Real-time scheduling of the thread that changes a sound.

pyo computes a block with Python's global lock held. Where JACK gives pyo's thread a real-time
priority, that thread still waits for whoever has the lock; on a busy computer an ordinary thread
with the lock waits for all other programs first. So the thread that gives the changes follows.
"""

import os
import sys
import threading
from pathlib import Path

PRIORITY = 1
"""Above all ordinary programs, and below JACK, which has 5 unless it was told otherwise."""


def others_are_real_time() -> bool:
    """Whether any other thread of this process has a real-time priority."""
    if sys.platform != "linux":
        return False
    own = threading.get_native_id()
    others = {int(task.name) for task in Path("/proc/self/task").iterdir()} - {own}
    return any(_policy(thread) in (os.SCHED_FIFO, os.SCHED_RR) for thread in others)


def _policy(thread: int) -> int:
    try:
        return os.sched_getscheduler(thread) & ~os.SCHED_RESET_ON_FORK
    except ProcessLookupError:  # it ended a moment ago
        return os.SCHED_OTHER


def follow() -> str:
    """Give the calling thread a real-time priority if another one has it; say what it has now.

    Threads and processes that it starts later keep an ordinary one.
    """
    if not others_are_real_time():
        return "ordinary"
    try:
        _schedule(os.SCHED_FIFO, PRIORITY)
    except PermissionError:  # JACK may have asked a service that is allowed more than this user
        return "ordinary, only JACK's is real time"
    return "real time"


def unfollow() -> None:
    """Make the calling thread an ordinary one again."""
    _schedule(os.SCHED_OTHER, 0)


def _schedule(policy: int, priority: int) -> None:
    # 0 is the calling thread. Who is not root may set the flag, and never take it away again.
    os.sched_setscheduler(0, policy | os.SCHED_RESET_ON_FORK, os.sched_param(priority))
