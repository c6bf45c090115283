"""Compiled kernel of a component's tick, for simulations.

A component can also offer its tick as a compiled function: :meth:`labcrane.Component.kernel`. If
the operator, the scheme, the machine and the task of a study all have one, ``labcrane simulate``
computes most ticks by them, about a hundred times faster; otherwise by the loop. Both give the same
bits, which ``labcrane.testing`` checks tick by tick.

A kernel computes only ticks without any event for Python. In all others, as when a plan is made, an
event is reported or a trial ends, it declines, and the component itself computes that tick: so a
kernel is the small part of a component that takes the time, not a second implementation of it.

Kernels use no ``math.hypot``, ``math.dist`` or ``sum`` of floats, which Python 3.12 rounds
differently. A C extension would need a compiler, or wheels for every system, from plugin authors
too. Numba loads slowly, so sessions with people do without it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from labcrane.core.records import Frame
    from labcrane.types import FloatArray

Places: TypeAlias = "npt.NDArray[np.int64]"
"""Where in a row the axes, the command, the state and the task begin, and where it ends."""

MADE, DECLINED = 0, 1
"""Results of a compiled tick."""

AXES, COMMAND, STATE, TASK, END = range(5)
"""Entries of ``places`` for a row, in order."""

ELAPSED, TIME = 5, 1
"""Numbers of a row for a task: seconds of the trial so far, and when the tick is due."""


def _always(_own: FloatArray, _seen: Frame) -> bool:
    return True


def _nothing(_own: FloatArray, _rows: FloatArray, _places: Places) -> None:
    pass


@dataclass(frozen=True, slots=True)
class Kernel:
    """The compiled tick of one component, and its state.

    Attributes
    ----------
    tick
        Compiled by the function of the component's role in :mod:`labcrane.core.compiled`. It is
        given ``own``, ``places``, the row of the frame before and the row under way, into which it
        writes its part; it returns :data:`MADE` or :data:`DECLINED`. Its changes in a tick that
        any kernel declines are undone.
    own
        Its whole state, shape ``(n,)``; private to the kernel.
    changing
        Number of leading values of ``own`` that a tick can change.
    take_over
        ``take_over(own, seen)`` copies from the component what has changed, before the first of
        some ticks; ``seen`` is the frame before. It returns whether the kernel can continue.
    hand_back
        ``hand_back(own, rows, places)`` copies what has changed to the component, after the last of
        some ticks; ``rows`` are theirs, shape ``(n_ticks, n_columns)``.
    inverse
        For a controller: the compiled ``inverse``. It is given ``own``, ``places``, a tip velocity
        in m/s, shape ``(3,)``, the row of the frame before and the row into which it writes axes.
    deviation
        Tolerated difference of its numbers from the component's; 0 for the same bits.
    """

    tick: Any
    own: FloatArray
    changing: int
    take_over: Callable[[FloatArray, Frame], bool] = _always
    hand_back: Callable[[FloatArray, FloatArray, Places], None] = _nothing
    inverse: Any = None
    deviation: float = 0.0
