"""A JACK server without hardware, and whether it may run in real time here."""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

PRIORITY = 70


def real_time_is_allowed() -> bool:
    """Try, in a process of its own, whether this user may have JACK's real-time priority."""
    asked = f"import os; os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param({PRIORITY}))"
    done = subprocess.run([sys.executable, "-c", asked], capture_output=True, check=False)
    return done.returncode == 0


@contextmanager
def a_jack_server(folder: Path, *, real_time: bool = False) -> Iterator[tuple[str, Path]]:
    """Start a JACK server whose blocks are due in time; give its name and its log."""
    name, log = f"labcrane-{os.getpid()}", folder / "jack.log"
    driver = ["-d", "dummy", "-r", "48000", "-p", "1024"]
    how = ["--realtime", "--realtime-priority", str(PRIORITY)] if real_time else ["--no-realtime"]
    with log.open("w") as file:
        server = subprocess.Popen(["jackd", "-n", name, *how, *driver], stdout=file, stderr=file)
        try:
            waiting = ["jack_wait", "-s", name, "-w", "-t", "20"]
            subprocess.run(waiting, capture_output=True, check=True)
            yield name, log
        finally:
            server.terminate()
            server.wait()


def underruns(log: Path) -> list[str]:
    """Return what a JACK server has to say of blocks that were not there in time."""
    return [line for line in log.read_text().splitlines() if "XRun" in line]
