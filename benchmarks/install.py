"""Installations, lean and full, each in a fresh environment: seconds and megabytes.

    python -m benchmarks.install

The time includes downloads that pip has not cached; run it twice for the time without them.
"""

import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).parents[1]


def installed(what: str, folder: Path) -> tuple[float, float, int]:
    """Return the duration in s, the added size in MB, and the number of installed projects."""
    subprocess.run([sys.executable, "-m", "venv", folder], check=True)
    python = folder / "bin" / "python"
    (packages,) = folder.glob("lib/python*/site-packages")
    before, began = size_mb(packages), time.perf_counter()
    subprocess.run([python, "-m", "pip", "install", "-q", what], check=True)
    took = time.perf_counter() - began
    return took, size_mb(packages) - before, len(list(packages.glob("*.dist-info"))) - 1


def size_mb(folder: Path) -> float:
    """Return what the files below a folder take, in MB."""
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file()) / 1e6


def main() -> None:
    """Install both, and print a row of each."""
    for name, what in (("lean", str(ROOT)), ("full", f"{ROOT}[lab]")):
        with tempfile.TemporaryDirectory() as folder:
            took, size, projects = installed(what, Path(folder) / "venv")
        print(f"| {name} | {took:.0f} s | {size:.0f} MB | {projects} |")


if __name__ == "__main__":
    main()
