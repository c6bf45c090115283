"""Halts of a movement, and the main stroke between them."""

from dataclasses import dataclass

import numpy as np

from labcrane.analysis.kinematics.onset import ROUNDING_S
from labcrane.types import FloatArray


@dataclass(frozen=True, slots=True)
class Halts:
    """How a movement is made of strokes.

    Attributes
    ----------
    count, seconds
        Halts between onset and offset, and how long they are together, in s.
    main_stroke_s
        Of the stroke with the highest speed: from the onset or the halt before it to the halt or
        the rest behind it, in s.
    """

    count: int
    seconds: float
    main_stroke_s: float


def halts(elapsed: FloatArray, speed: FloatArray, *, threshold: float, hold_s: float) -> Halts:
    """Return the halts of a movement.

    A halt is a stretch of at least ``hold_s`` in which the tip is never faster than ``threshold``:
    the rule of the onset turned over, so that strokes and halts make up the movement. The rest in
    which a movement ends is no halt, and belongs to no stroke.

    Parameters
    ----------
    elapsed, speed
        From onset to offset, in s and m/s, shape ``(n,)``.
    threshold, hold_s
        In m/s and s: those of the onset.
    """
    slow = np.concatenate([[False], speed <= threshold])
    turns = np.flatnonzero(np.diff(slow, append=False))
    # From the first slow tick to the first fast one behind it; at the end to the last tick.
    times = np.append(elapsed, elapsed[-1])[turns].reshape(-1, 2)
    held = times[times[:, 1] - times[:, 0] >= hold_s - ROUNDING_S]
    within = held[held[:, 1] < elapsed[-1]]
    peak = elapsed[int(np.argmax(speed))]
    before, after = held[held[:, 1] <= peak, 1], held[held[:, 0] > peak, 0]
    return Halts(
        count=len(within),
        seconds=float((within[:, 1] - within[:, 0]).sum()),
        main_stroke_s=float(min(after, default=elapsed[-1]) - max(before, default=elapsed[0])),
    )
