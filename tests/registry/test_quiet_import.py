"""Modules that greet from C do not fill the terminal, and nothing else is hidden."""

import subprocess
import sys
from pathlib import Path

from programs import ran

GREETING = 'import os\nos.write(2, b"hello from C\\n")\nplace = "here"\n'


def said(program: str, folder: Path) -> "subprocess.CompletedProcess[str]":
    (folder / "greeting.py").write_text(GREETING, encoding="utf-8")
    (folder / "broken.py").write_text(
        GREETING + 'raise OSError("no such engine")\n', encoding="utf-8"
    )
    return ran(
        [
            sys.executable,
            "-c",
            f"import os\nfrom labcrane.registry import quietly_imported\n{program}",
        ],
        env={"PYTHONPATH": str(folder)},
    )


def test_a_greeting_is_hidden_and_what_is_said_afterwards_is_not(tmp_path: Path) -> None:
    done = said('print(quietly_imported("greeting").place)\nos.write(2, b"after")', tmp_path)
    assert (done.stdout, done.stderr) == ("here\n", "after")


def test_why_a_module_cannot_be_imported_is_seen(tmp_path: Path) -> None:
    done = said('quietly_imported("broken")', tmp_path)
    assert done.returncode == 1
    assert "hello" not in done.stderr
    assert done.stderr.endswith("OSError: no such engine\n")
