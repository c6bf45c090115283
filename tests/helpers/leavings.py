"""What a run of tests started ends with it, however the run ends.

    python tests/helpers/leavings.py PID TOKEN

Devices, witnesses and sessions of a run that was killed would go on for minutes and answer the next
run. All processes of a run inherit ``RUN`` with a token of its own; a watcher that is none of them
waits until the run has ended and kills what still carries the token.
"""

import os
import secrets
import subprocess
import sys
import time

import psutil

RUN = "LABCRANE_TESTS_RUN"
GRACE_S = 5.0
"""Workers of a run that was killed notice it themselves, and clean up."""


def watch() -> None:
    """Start the watcher of this run, and mark what this process starts from now on."""
    token = secrets.token_hex(8)
    words = [sys.executable, __file__, str(os.getpid()), token]
    ours = {name: value for name, value in os.environ.items() if name != RUN}
    nowhere = subprocess.DEVNULL
    subprocess.Popen(  # in a session of its own: what interrupts the run does not reach it
        words, env=ours, start_new_session=True, stdin=nowhere, stdout=nowhere, stderr=nowhere
    )
    os.environ[RUN] = token


def left(token: str) -> list[psutil.Process]:
    """Return the processes that carry ``token``."""
    return [process for process in psutil.process_iter() if _token(process) == token]


def _token(process: psutil.Process) -> str | None:
    try:
        return process.environ().get(RUN)
    except (psutil.Error, OSError):  # another user's, or it has just ended
        return None


def main(pid: int, token: str) -> None:
    """Wait for the end of process ``pid``, then kill what is left of its run."""
    try:
        run = psutil.Process(pid)
    except psutil.NoSuchProcess:
        pass
    else:
        while run.is_running() and run.status() != psutil.STATUS_ZOMBIE:
            time.sleep(0.5)
    until = time.monotonic() + GRACE_S
    while left(token) and time.monotonic() < until:
        time.sleep(0.2)
    for process in left(token):
        process.kill()


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2])
