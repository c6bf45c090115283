"""Start-up of the command line, beside the libraries that it is made of.

    python -m benchmarks.start_up

Processes alternate. The fastest of each kind counts, because it was disturbed least. For rehearsals
the slowest counts, because an office computer is not idle. All modules are compiled, as after an
installation with pip; a checkout may be uncompiled and read-only.
"""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

from benchmarks.table import Row, show

ROUNDS = 15
AIMING = Path(__file__).parents[1] / "protocols" / "aiming" / "protocol.yaml"
LIBRARIES = """
import typer, rich, pydantic, ruamel.yaml
class Settings(pydantic.BaseModel):  # pydantic loads what it needs for the first of them
    rate_hz: float
"""
CASES = {
    "import typer, rich": ["-c", "import typer, rich"],
    "labcrane --help": ["-m", "labcrane", "--help"],
    "import typer, rich, pydantic, ruamel.yaml": ["-c", LIBRARIES],
    "labcrane check": ["-m", "labcrane", "check", str(AIMING)],
}
LIMITS = {
    "labcrane --help": ("import typer, rich", 1.85),
    "labcrane check": ("import typer, rich, pydantic, ruamel.yaml", 2.2),
}
"""The reference of each, and how much longer it may take."""

REHEARSAL = ["-m", "labcrane", "check", str(AIMING), "--rehearse"]
REHEARSALS = 3
PATIENCE_S = 8.0
"""Longest acceptable wait for a rehearsal of the aiming study."""


def rows(*, brief: bool = False) -> list[Row]:
    """Return what start-up takes beside its libraries, and a rehearsal in seconds."""
    rounds, rehearsals = (1, 1) if brief else (ROUNDS, REHEARSALS)
    took: dict[str, list[float]] = {name: [] for name in CASES}
    with tempfile.TemporaryDirectory() as compiled:
        keeping = {k: value for k, value in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
        keeping["PYTHONPYCACHEPREFIX"] = compiled
        for _ in range(rounds):
            for name, words in CASES.items():
                took[name].append(_seconds(words, keeping))
        rehearsed = max(_seconds(REHEARSAL, keeping) for _ in range(rehearsals))
    return [
        *(
            Row("start-up", f"{name}, s", min(took[name]), min(took[bare]), bare, limit)
            for name, (bare, limit) in LIMITS.items()
        ),
        Row(
            "start-up",
            "labcrane check --rehearse, s",
            rehearsed,
            PATIENCE_S,
            "what is promised",
            1.0,
        ),
    ]


def _seconds(words: Sequence[str], environment: Mapping[str, str]) -> float:
    """Return how long a Python takes for this, from its start to its end."""
    began = time.perf_counter()
    run = [sys.executable, *words]
    subprocess.run(run, check=True, stdout=subprocess.DEVNULL, env=environment)
    return time.perf_counter() - began


if __name__ == "__main__":
    show(rows())
