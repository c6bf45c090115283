"""Compiler of twins: numba, with the one calling convention of each role.

Numba is an extra and loads for a second: it is loaded when the first function is compiled, so
import a module with compiled functions in :meth:`labcrane.Component.twin` and nowhere else.
Arithmetic is Python's, operation by operation: nothing is reordered or fused, and a root, a sine or
a cube root is the C library's, as Python's is. ``math.hypot`` and ``math.dist`` are not: Python
3.12 rounds them otherwise than 3.11. Write the root of a sum of squares, here and in the component.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, TypeVar

F = TypeVar("F", bound=Callable[..., Any])


@dataclass(frozen=True, slots=True)
class Signatures:
    """What compiled functions are given and return, as numba writes it.

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


def part(function: F) -> F:
    """Compile a function that others in the same module call."""
    return _compiled(function)


def tick(function: F) -> F:
    """Compile the tick of a controller, a machine or a task.

    ``function(own, places, seen, row)``: all of float64, but ``places`` of int64.
    """
    return _compiled(function, signatures().tick)


def inverse(function: F) -> F:
    """Compile the inverse of a controller: ``function(own, places, velocity, seen, row)``."""
    return _compiled(function, signatures().inverse)


def read(function: F) -> F:
    """Compile the tick of an input device.

    ``function(own, places, seen, row, inverse, theirs)``: the last two are the controller's inverse
    and what its twin knows, to be called as ``inverse(theirs, places, velocity, seen, row)``.
    """
    return _compiled(function, signatures().read)


def _compiled(function: F, *signature: Any) -> F:
    import numba  # noqa: PLC0415

    compile_it: Any = numba.njit  # some versions have types, for fewer ways to call it
    made: F = compile_it(*signature, cache=True, error_model="numpy", fastmath=False)(function)
    return made
