"""Halts of a movement, and the main stroke between them."""

import numpy as np

from labcrane.types import FloatArray

ROUNDING_S = 1e-9
"""Elapsed times are sums of whole ticks."""


def halts(
    elapsed: FloatArray, speed: FloatArray, *, threshold: float, hold_s: float
) -> dict[str, float]:
    """Return the halts of a movement: ``halts``, ``halt_time`` and ``main_stroke_time``.

    In a stroke the tip is faster than ``threshold`` for at least ``hold_s``, as at an onset; a halt
    is at least ``hold_s`` between two strokes. So noise that passes the threshold briefly makes
    no halt and ends none. The final rest of a movement is not a halt, and belongs to no stroke. The
    main stroke, the one with the highest speed, takes 0 s where none is long enough.

    Parameters
    ----------
    elapsed, speed
        From onset to offset, in s and m/s, shape ``(n,)``.
    threshold, hold_s
        In m/s and s: those of the onset.
    """
    turns = np.flatnonzero(np.diff(speed > threshold, prepend=False, append=False))
    # From the first fast tick to the first slow one behind it; at the end to the last tick.
    fast = np.append(elapsed, elapsed[-1])[turns].reshape(-1, 2)
    strokes = fast[fast[:, 1] - fast[:, 0] >= hold_s - ROUNDING_S]
    gaps = strokes[1:, 0] - strokes[:-1, 1]
    held = gaps >= hold_s - ROUNDING_S
    begins = np.concatenate([strokes[:1, 0], strokes[1:, 0][held]])
    ends = np.concatenate([strokes[:-1, 1][held], strokes[-1:, 1]])
    main = (begins <= elapsed[np.argmax(speed)]).nonzero()[0][-1:]
    return {
        "halts": int(held.sum()),
        "halt_time": float(gaps[held].sum()),
        "main_stroke_time": float((ends[main] - begins[main]).sum()),
    }
