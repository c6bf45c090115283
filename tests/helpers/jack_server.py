"""A JACK server without hardware."""

import fcntl
import os
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from needs import REAL_TIME_PRIORITY, need


@contextmanager
def a_jack_server(folder: Path, *, real_time: bool = False) -> Iterator[tuple[str, Path]]:
    """Start a JACK server whose blocks are due in time; give its name and its log.

    There is one at a time: JACK names a client's socket by the client and the user alone, so that
    clients of one name break each other's connection, even where their servers differ.
    """
    need("jackd", "jack_wait", *(["real-time priorities"] if real_time else []))
    name, log = f"labcrane-{os.getpid()}", folder / "jack.log"
    driver = ["-d", "dummy", "-r", "48000", "-p", "1024"]
    how = (
        ["--realtime", "--realtime-priority", str(REAL_TIME_PRIORITY)]
        if real_time
        else ["--no-realtime"]
    )
    lock = Path(tempfile.gettempdir(), "labcrane-jack.lock")
    with lock.open("w", encoding="utf-8") as only, log.open("w", encoding="utf-8") as file:
        fcntl.flock(only, fcntl.LOCK_EX)
        server = subprocess.Popen(["jackd", "-n", name, *how, *driver], stdout=file, stderr=file)
        try:
            waiting = ["jack_wait", "-s", name, "-w", "-t", "60"]
            done = subprocess.run(waiting, capture_output=True, check=False)
            assert not done.returncode, f"no JACK server: {log.read_text(encoding='utf-8')}"
            yield name, log
        finally:
            server.terminate()
            server.wait()


def underruns(log: Path) -> list[str]:
    """Return what a JACK server has to say of blocks that were not there in time."""
    return [line for line in log.read_text(encoding="utf-8").splitlines() if "XRun" in line]
