"""Programs that are run to their end."""

import os
import subprocess
from collections.abc import Mapping, Sequence
from typing import Any


def ran(
    command: Sequence[object],
    env: Mapping[str, str] | None = None,
    *,
    check: bool = False,
    **how: Any,
) -> "subprocess.CompletedProcess[str]":
    """Run a program, with more in its environment; return what came of it."""
    how = {"capture_output": True, "encoding": "utf-8", "env": {**os.environ, **(env or {})}} | how
    return subprocess.run([*map(str, command)], check=check, **how)
