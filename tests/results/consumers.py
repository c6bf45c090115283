"""Programs of others that must read what labcrane writes."""

import json
import os
import subprocess
import sys
from pathlib import Path

from needs import needs
from programs import ran

needs_r = needs("Rscript", "afex", "hdf5r", "rhdf5")
needs_emmeans = needs("Rscript", "afex", "emmeans")
needs_octave = needs("octave-cli")


SAY = 'say <- function(key, ...) cat(key, sprintf("%.17g", c(...)), sep = "|", fill = 10000);'


def r(script: str, *arguments: object) -> str:
    """Run a script in R, which may ``say(key, numbers)``; return what it prints."""
    return _run(["Rscript", "--vanilla", "-e", SAY + script, *map(str, arguments)])


def octave(script: str, argument: object) -> str:
    """Run a script in Octave, with ``argument`` set to a path; return what it prints."""
    return _run(["octave-cli", "-q", "--eval", f"argument = '{argument}';\n{script}"])


def bids_errors(folder: Path) -> list[str]:
    """Return what the BIDS validator calls an error in a data set: code and file."""
    program = Path(sys.executable).with_name("bids-validator-deno")
    done = ran([program, "--json", folder])
    issues = json.loads(done.stdout)["issues"]["issues"]
    return [f"{i['code']} {i.get('location')}" for i in issues if i["severity"] == "error"]


def _run(command: list[str]) -> str:
    environment = os.environ | {"LC_ALL": "C.UTF-8"}
    done = subprocess.run(
        command, capture_output=True, encoding="utf-8", check=False, env=environment
    )
    assert done.returncode == 0, done.stderr + done.stdout
    return done.stdout


def table(text: str, marker: str = "|") -> dict[str, list[str]]:
    """Return printed lines of the form ``key|value|value`` by their keys."""
    rows = (line.split(marker) for line in text.splitlines() if marker in line)
    return {key: values for key, *values in rows}


def under(folder: Path) -> list[str]:
    """Return all files below a folder, by their paths in it."""
    return sorted(
        path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()
    )
