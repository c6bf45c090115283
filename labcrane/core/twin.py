"""Twin of a component: its tick, compiled, for simulations.

A component that makes the same numbers over and over can offer its tick as a compiled function
besides: :meth:`labcrane.Component.twin`. When the operator, the scheme, the machine and the task of
a study all have one, ``labcrane simulate`` makes most ticks by them, about a hundred times faster;
otherwise by the loop. Both make the same bits, which ``labcrane.testing`` checks tick by tick.

A twin makes only the ticks in which nothing happens that Python must know of. In all others, as
when a plan is made, an event is to be told or a trial ends, it declines, and the component itself
makes that tick: so a twin is the small part of a component that costs the time, and never its
second life.
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
"""What a compiled tick returns."""

AXES, COMMAND, STATE, TASK, END = range(5)
"""What ``places`` says of a row, in order."""

ELAPSED, TIME = 5, 1
"""Numbers of a row for a task: seconds of the trial so far, and when the tick is due."""


def _always(_own: FloatArray, _seen: Frame) -> bool:
    return True


def _nothing(_own: FloatArray, _rows: FloatArray, _places: Places) -> None:
    pass


@dataclass(frozen=True, slots=True)
class Twin:
    """The compiled tick of one component, and what it knows.

    Attributes
    ----------
    tick
        Compiled by the decorator of the component's role in :mod:`labcrane.core.compiled`. It is
        given ``own``, ``places``, the row of the frame before and the row under way, into which it
        writes its part; it returns :data:`MADE` or :data:`DECLINED`. What it changed in a tick that
        somebody declines is put back.
    own
        Everything it knows, shape ``(n,)``; nobody else looks into it.
    changing
        How many numbers of ``own``, from the first, a tick can change.
    take_over
        ``take_over(own, seen)`` copies from the component what has changed, before the first of
        some ticks; ``seen`` is the frame before. It says whether the twin can go on from there.
    hand_back
        ``hand_back(own, rows, places)`` copies what has changed to the component, after the last of
        some ticks; ``rows`` are theirs, shape ``(n_ticks, n_columns)``.
    inverse
        Of a controller: the compiled ``inverse``. It is given ``own``, ``places``, a tip velocity
        in m/s, shape ``(3,)``, the row of the frame before and the row into which it writes axes.
    deviation
        By how much its numbers may differ from the component's; 0 for the same bits.
    """

    tick: Any
    own: FloatArray
    changing: int
    take_over: Callable[[FloatArray, Frame], bool] = _always
    hand_back: Callable[[FloatArray, FloatArray, Places], None] = _nothing
    inverse: Any = None
    deviation: float = 0.0
