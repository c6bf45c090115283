"""Real-time scheduling of the thread that changes a sound.

pyo computes a block while it holds Python's global lock. Even if JACK gives pyo's thread a
real-time priority, that thread waits for the thread that has the lock. On a busy computer, an
ordinary thread with the lock waits for all other programs first. So the thread that sends the
changes gets a real-time priority, too.
"""

import os
import sys
import threading
from pathlib import Path

PRIORITY = 1
"""Above all ordinary programs, and below JACK, whose default is 5."""


def follow() -> str:
    """Give the calling thread a real-time priority if another one has it; return the new one.

    Threads and processes that it starts later keep an ordinary one.
    """
    if not others_are_real_time():
        return "ordinary"
    if not _schedule(real_time=True):  # JACK may have asked a service that is allowed more
        return "ordinary, only JACK's is real time"
    return "real time"


def unfollow() -> None:
    """Make the calling thread an ordinary one again."""
    _schedule(real_time=False)


if sys.platform == "linux":

    def others_are_real_time() -> bool:
        """Whether any other thread of this process has a real-time priority."""
        own = threading.get_native_id()
        others = {int(task.name) for task in Path("/proc/self/task").iterdir()} - {own}
        return any(_policy(thread) in (os.SCHED_FIFO, os.SCHED_RR) for thread in others)

    def _policy(thread: int) -> int:
        try:
            return os.sched_getscheduler(thread) & ~os.SCHED_RESET_ON_FORK
        except ProcessLookupError:  # it ended a moment ago
            return os.SCHED_OTHER

    def _schedule(*, real_time: bool) -> bool:
        """Give the calling thread a priority; whether this user is allowed to."""
        policy, priority = (os.SCHED_FIFO, PRIORITY) if real_time else (os.SCHED_OTHER, 0)
        # 0 is the calling thread. Who is not root may set the flag, and never take it away again.
        try:
            os.sched_setscheduler(0, policy | os.SCHED_RESET_ON_FORK, os.sched_param(priority))
        except PermissionError:
            return False
        return True

else:

    def others_are_real_time() -> bool:
        """Whether any other thread has a real-time priority: asked where JACK is used, on Linux."""
        return False

    def _schedule(*, real_time: bool) -> bool:
        """Leave the calling thread as it is, an ordinary one."""
        return not real_time
