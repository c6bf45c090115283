"""Compiler of kernels: numba, with the one calling convention of each role.

Numba is an extra and loads for a second: it is loaded when the first function is compiled, so
compile in :meth:`labcrane.Component.kernel` and nowhere else. What is compiled runs in Python, too:
a component calls the functions of its law as they are, and its kernel is made of the same.
Arithmetic is Python's, operation by operation: nothing is reordered or fused, and a root, a sine or
a cube root is the C library's, as Python's is. ``math.hypot`` and ``math.dist`` are not: Python
3.12 rounds differently from 3.11. Write the root of a sum of squares, here and in the component.

Compiled code is cached next to its source for the next run. If several processes need it at once,
as all that simulate a cohort do on a computer where nothing was compiled yet, one compiles and the
others wait for it: each would need the same time by itself.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from math import cbrt
from pathlib import Path
from types import FunctionType
from typing import Any, TypeVar

from labcrane.files.lock import exclusive

TURN = "labcrane.lock"
"""File locked by the process that compiles, in numba's cache folder."""

F = TypeVar("F", bound=Callable[..., Any])


@dataclass(frozen=True, slots=True)
class Signatures:
    """Signatures of compiled functions, in numba's notation.

    Attributes
    ----------
    tick, inverse, read
        Of the functions of the same names below.
    """

    tick: Any
    inverse: Any
    read: Any


@cache
def signatures() -> Signatures:
    """Return the calling conventions."""
    from numba import types  # noqa: PLC0415

    numbers, places = types.Array(types.float64, 1, "C"), types.Array(types.int64, 1, "C")
    inverse = types.int64(numbers, places, numbers, numbers, numbers)
    hands = types.FunctionType(inverse)
    return Signatures(
        tick=types.int64(numbers, places, numbers, numbers),
        inverse=inverse,
        read=types.int64(numbers, places, numbers, numbers, hands, numbers),
    )


@cache
def also(function: F, signature: Any = None) -> F:
    """Compile a function that Python runs as well, and those of its module that it calls.

    They are compiled again when this module changes: keep what they call in it. Of the cube root,
    which numba has from numpy alone, Python's own gives the same bits as the compiled one.
    """
    import numpy as np  # noqa: PLC0415 - loads with numba anyway

    known = function.__globals__
    calls = {name: known[name] for name in function.__code__.co_names if name in known}
    same = {name: each for name, each in calls.items() if isinstance(each, FunctionType)}
    inner: dict[str, Any] = {name: also(each) for name, each in same.items()}
    inner |= {name: np.cbrt for name, each in calls.items() if each is cbrt}
    made: Any = FunctionType(function.__code__, known | inner, function.__name__)
    made.__module__, made.__qualname__ = function.__module__, function.__qualname__
    compiled: F = compile_function(made, signature)
    return compiled


def tick(function: F) -> F:
    """Compile the tick of a controller, a machine or a task.

    ``function(own, places, seen, row)``: all of float64, but ``places`` of int64.
    """
    compiled: F = also(function, signatures().tick)
    return compiled


def inverse(function: F) -> F:
    """Compile the inverse of a controller: ``function(own, places, velocity, seen, row)``."""
    compiled: F = also(function, signatures().inverse)
    return compiled


def read(function: F) -> F:
    """Compile the tick of an input device.

    ``function(own, places, seen, row, inverse, theirs)``: the last two are the controller's inverse
    and the array of its kernel, to be called as ``inverse(theirs, places, velocity, seen, row)``.
    """
    compiled: F = also(function, signatures().read)
    return compiled


def compile_function(function: F, signature: Any = None) -> F:
    """Compile a function, now where its signature is given, else when it is called first."""
    import numba  # noqa: PLC0415

    compile_it: Any = numba.njit  # some versions have types, for fewer ways to call it
    made: Any = compile_it(cache=True, error_model="numpy", fastmath=False)(function)
    if signature is not None:
        with exclusive(Path(made.stats.cache_path) / TURN):
            made.compile(signature)
        made.disable_compile()
    kept: F = made
    return kept
