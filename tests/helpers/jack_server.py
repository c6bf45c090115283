"""A JACK server without hardware."""

import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from needs import REAL_TIME_PRIORITY, need


@contextmanager
def a_jack_server(folder: Path, *, real_time: bool = False) -> Iterator[tuple[str, Path]]:
    """Start a JACK server whose blocks are due in time; give its name and its log."""
    need("jackd", "jack_wait", *(["real-time priorities"] if real_time else []))
    name, log = f"labcrane-{os.getpid()}", folder / "jack.log"
    driver = ["-d", "dummy", "-r", "48000", "-p", "1024"]
    how = (
        ["--realtime", "--realtime-priority", str(REAL_TIME_PRIORITY)]
        if real_time
        else ["--no-realtime"]
    )
    with log.open("w", encoding="utf-8") as file:
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
