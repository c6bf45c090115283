"""Compiler of twins: numba, with the one calling convention of each role.

Import it where a twin is made and nowhere else: numba is an extra, and loads for a second.
Arithmetic is Python's, operation by operation: nothing is reordered or fused, and a root, a sine
or a cube is the C library's, as Python's is. ``math.hypot`` and ``math.dist`` are not: Python 3.12
rounds them otherwise than 3.11. Write the root of a sum of squares, here and in the component.
"""

from collections.abc import Callable
from typing import Any, TypeVar

import numba
from numba import types

F = TypeVar("F", bound=Callable[..., Any])

_NUMBERS = types.Array(types.float64, 1, "C")
_PLACES = types.Array(types.int64, 1, "C")
_OPTIONS = {"cache": True, "error_model": "numpy", "fastmath": False}
_njit: Any = numba.njit  # typed by some versions only, and then by what options are written out

TICK = types.int64(_NUMBERS, _PLACES, _NUMBERS, _NUMBERS)
INVERSE = types.int64(_NUMBERS, _PLACES, _NUMBERS, _NUMBERS, _NUMBERS)
READ = types.int64(_NUMBERS, _PLACES, _NUMBERS, _NUMBERS, types.FunctionType(INVERSE), _NUMBERS)


def part(function: F) -> F:
    """Compile a function that others in the same module call."""
    compiled: F = _njit(**_OPTIONS)(function)
    return compiled


def tick(function: F) -> F:
    """Compile the tick of a controller, a machine or a task.

    ``function(own, places, seen, row)``: all of float64, but ``places`` of int64.
    """
    compiled: F = _njit(TICK, **_OPTIONS)(function)
    return compiled


def inverse(function: F) -> F:
    """Compile the inverse of a controller: ``function(own, places, velocity, seen, row)``."""
    compiled: F = _njit(INVERSE, **_OPTIONS)(function)
    return compiled


def read(function: F) -> F:
    """Compile the tick of an input device.

    ``function(own, places, seen, row, inverse, theirs)``: the last two are the controller's inverse
    and what its twin knows, to be called as ``inverse(theirs, places, velocity, seen, row)``.
    """
    compiled: F = _njit(READ, **_OPTIONS)(function)
    return compiled
