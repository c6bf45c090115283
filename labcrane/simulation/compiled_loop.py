"""Kernel of a simulation: many ticks by compiled kernels; import it only where numba is."""

import math
import random
from typing import Any

import numpy as np
from numba import types
from numba.extending import typeof_impl

from labcrane.core.compiled import compile_function, signatures
from labcrane.core.kernel import AXES, MADE, TASK, Places
from labcrane.types import FloatArray

_NUMBERS = types.Array(types.float64, 1, "C")
_ROWS = types.Array(types.float64, 2, "C")
_PLACES = types.Array(types.int64, 1, "C")
_OF = signatures()
_READ, _INVERSE, _TICK = (types.FunctionType(each) for each in (_OF.read, _OF.inverse, _OF.tick))
_SIGNATURE = types.int64(
    _ROWS, _NUMBERS, _PLACES, _NUMBERS, _NUMBERS, types.int64,
    _READ, _NUMBERS, _INVERSE, _TICK, _NUMBERS, _TICK, _NUMBERS, _TICK, _NUMBERS, _PLACES,
)  # fmt: skip


class Address(types.WrapperAddressProtocol):  # type: ignore[misc, unused-ignore]  # without types
    """A compiled function that is found once: numba looks up a function at every call."""

    def __init__(self, function: Any, signature: Any) -> None:
        result = function.get_compile_result(signature)
        name = result.fndesc.llvm_cfunc_wrapper_name
        self._function, self._signature = function, signature  # kept, so that its code is
        self.type = types.FunctionType(signature)
        self._address = int(result.library.get_pointer_to_function(name))

    def __wrapper_address__(self) -> int:
        return self._address

    def signature(self) -> Any:
        return self._signature


@typeof_impl.register(Address)
def _type_of(address: Address, _context: Any) -> Any:
    """Return what numba takes it for; numba itself would make a new type at every call."""
    return address.type


def addresses(read: Any, inverse: Any, *ticks: Any) -> tuple[Address, ...]:
    """Return the functions of the operator, of the controller's inverse, and ticks."""
    others = (Address(tick, _OF.tick) for tick in ticks)
    return (Address(read, _OF.read), Address(inverse, _OF.inverse), *others)


def _advance(
    rows: FloatArray, seen: FloatArray, places: Places, about: FloatArray, kept: FloatArray,
    first: int,
    read: Any, hands: FloatArray, inverse: Any, command: Any, scheme: FloatArray,
    step: Any, machine: FloatArray, evaluate: Any, task: FloatArray, changing: Places,
) -> int:  # fmt: skip
    """Compute ticks into ``rows`` until a component declines one; return how many.

    Parameters
    ----------
    seen
        The row of the frame before.
    about
        Start of the run in s, rate in Hz, trial, ticks of the trial so far, code of its phase.
    kept
        Room for what is put back when a tick is declined.
    first
        Number of the first tick.
    changing
        How much of what hands, scheme, machine and task know can change in a tick.
    """
    start, rate, trial, before, phase = about[0], about[1], about[2], about[3], about[4]
    a, b = changing[0], changing[0] + changing[1]
    c = b + changing[2]
    d = c + changing[3]
    made = 0
    while made < len(rows):
        row = rows[made]
        number = first + made
        due = start + number / rate
        row[0], row[1], row[2], row[3] = number, due, due, 0.0
        row[4], row[5], row[6], row[7] = trial, (before + made) / rate, phase, 0.0
        kept[:a], kept[a:b] = hands[:a], scheme[: b - a]
        kept[b:c], kept[c:d] = machine[: c - b], task[: d - c]
        refused = read(hands, places, seen, row, inverse, scheme)
        if refused == MADE:
            refused = command(scheme, places, seen, row)
        if refused == MADE:
            refused = step(machine, places, seen, row)
        if refused == MADE:
            refused = evaluate(task, places, seen, row)
        if refused == MADE:
            total = 0.0
            for k in range(places[AXES], places[TASK]):
                total += row[k] * 0.0  # NaN if one is not a number: the loop names its component
            refused = 0 if total == 0.0 else 1
        if refused != MADE:
            hands[:a], scheme[: b - a] = kept[:a], kept[a:b]
            machine[: c - b], task[: d - c] = kept[b:c], kept[c:d]
            break
        seen = row
        made += 1
    return made


advance = compile_function(_advance, _SIGNATURE)


@compile_function
def _functions(x: float, out: FloatArray) -> None:
    out[0], out[1], out[2], out[3] = math.sin(x), math.cos(x), math.sinh(x), math.asinh(x)
    out[4], out[5], out[6] = np.cbrt(x), math.sqrt(abs(x)), x * x - x * 0.1 + x / 3.0


def same_arithmetic() -> bool:
    """Whether compiled functions give Python's bits on this computer.

    They call the C library's, as Python does, on the systems that we test on; on others nobody
    promises it.
    """
    drawn, out = random.Random(0), np.zeros(7)  # noqa: S311 - no secret
    for _ in range(2000):
        x = drawn.gauss(0.0, 3.0)
        _functions(x, out)
        root = math.sqrt(abs(x))
        mixed = x * x - x * 0.1 + x / 3.0
        wanted = [math.sin(x), math.cos(x), math.sinh(x), math.asinh(x), math.cbrt(x), root, mixed]
        if out.tolist() != wanted:
            return False
    return True
