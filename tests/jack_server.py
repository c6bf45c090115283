"""A JACK server without hardware."""

import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def a_jack_server(folder: Path) -> Iterator[tuple[str, Path]]:
    """Start a JACK server without hardware, in real time; give its name and its log."""
    name, log = f"labcrane-{os.getpid()}", folder / "jack.log"
    driver = ["-d", "dummy", "-r", "48000", "-p", "1024"]
    with log.open("w") as file:
        server = subprocess.Popen(
            ["jackd", "-n", name, "--no-realtime", *driver], stdout=file, stderr=file
        )
        try:
            waiting = ["jack_wait", "-s", name, "-w", "-t", "20"]
            subprocess.run(waiting, capture_output=True, check=True)
            yield name, log
        finally:
            server.terminate()
            server.wait()
