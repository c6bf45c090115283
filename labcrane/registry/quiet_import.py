"""Import of modules that greet from C, without what they print."""

import os
import sys
from importlib import import_module
from types import ModuleType

STDERR = 2
"""Its number: C writes past ``sys.stderr``, where users look for what went wrong."""


def quietly_imported(name: str) -> ModuleType:
    """Import module ``name``; nothing that is written meanwhile reaches the standard error."""
    sys.stderr.flush()
    kept = os.dup(STDERR)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, STDERR)
        return import_module(name)
    finally:
        os.dup2(kept, STDERR)
        os.close(kept)
        os.close(nowhere)
