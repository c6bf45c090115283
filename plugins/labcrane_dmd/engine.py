"""PyBullet, imported without the line that it prints for everybody."""

import os
import sys

# The engine greets from C, past sys.stderr, where users look for what went wrong.
STDERR = 2
sys.stderr.flush()
_kept = os.dup(STDERR)
_nowhere = os.open(os.devnull, os.O_WRONLY)
try:
    os.dup2(_nowhere, STDERR)
    import pybullet
finally:
    os.dup2(_kept, STDERR)
    os.close(_kept)
    os.close(_nowhere)

__all__ = ["pybullet"]
