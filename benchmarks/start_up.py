"""Start-up of the command line, beside the two libraries that it is made of.

    python -m benchmarks.start_up

Processes alternate; of each kind the fastest counts, which is the one that nothing disturbed.
All modules are compiled, as pip leaves them: a checkout may not be, and not be allowed to keep what
was compiled.
"""

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.table import Row, show

ROUNDS = 15
AIMING = Path(__file__).parents[1] / "protocols" / "aiming" / "protocol.yaml"
CASES = {
    "bare": ["-c", "import typer, rich"],
    "labcrane --help": ["-m", "labcrane", "--help"],
    "labcrane check": ["-m", "labcrane", "check", str(AIMING)],
}
LIMITS = {"labcrane --help": 1.5, "labcrane check": 4.0}


def rows() -> list[Row]:
    """Return both figures."""
    took: dict[str, list[float]] = {name: [] for name in CASES}
    with tempfile.TemporaryDirectory() as compiled:
        keeping = {k: value for k, value in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
        keeping["PYTHONPYCACHEPREFIX"] = compiled
        for _ in range(ROUNDS):
            for name, words in CASES.items():
                began = time.perf_counter()
                run = [sys.executable, *words]
                subprocess.run(run, check=True, stdout=subprocess.DEVNULL, env=keeping)
                took[name].append(time.perf_counter() - began)
    bare = min(took["bare"])
    return [
        Row("start-up", f"{name}, s", min(took[name]), bare, "import typer, rich", limit)
        for name, limit in LIMITS.items()
    ]


if __name__ == "__main__":
    show(rows())
