"""Projects installed into an environment of their own, which sees labcrane as it is here."""

import os
import subprocess
import sys
import venv
from collections.abc import Iterable
from pathlib import Path


def run(*command: object, cwd: Path | None = None) -> "subprocess.CompletedProcess[str]":
    """Run a program to its end."""
    return subprocess.run(
        [*map(str, command)],
        cwd=cwd,
        env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1", "PIP_DISABLE_PIP_VERSION_CHECK": "1"},
        capture_output=True,
        encoding="utf-8",
        check=False,
    )


def environment_with(projects: Iterable[Path], folder: Path) -> Path:
    """Install projects without downloading anything; return the environment's Python."""
    python = environment(folder)
    options = ["--no-deps", "--no-build-isolation", "--no-index", "-q"]
    done = run(python, "-m", "pip", "install", *options, *projects)
    assert done.returncode == 0, done.stderr
    return python


def environment(folder: Path) -> Path:
    """Make an environment that sees what this one has; return its Python."""
    venv.create(folder, with_pip=True)
    python = folder / "bin" / "python"
    (here,) = folder.glob("lib/python*/site-packages")
    outer = [path for path in sys.path if path.endswith("site-packages")]
    # addsitedir also reads the .pth files of what is installed as editable.
    lines = [f"import site; site.addsitedir({path!r})\n" for path in outer]
    (here / "outer.pth").write_text("".join(lines), encoding="utf-8")
    for program in ("labcrane", "pytest"):
        path = folder / "bin" / program
        path.write_text(f'#!/bin/sh\nexec "{python}" -m {program} "$@"\n', encoding="utf-8")
        path.chmod(0o755)
    return python
