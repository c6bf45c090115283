"""Units of coarse clocks: what all stamps are whole ones apart."""

import numpy as np

from labcrane.types import FloatArray

MILLISECOND = 1e-3
LEAST_S, MOST_S = 5e-5, 1.0
"""Finer units are reported unchanged; no clock ticks in coarser ones."""

COUNTED_S = (1e-6, 2.0**-16, 1e-5)
"""Clocks count in decimal parts of a second, or in binary ones, as a number of 32 bits does. Times
since 1970 are blurred by more than a tenth of the first."""

WHOLE = 0.25
ENOUGH = 8
"""So many stamps that are so nearly whole ones apart are not so by chance."""


def find(stamps: FloatArray) -> float:
    """Return the unit of which stamps are whole ones apart, in seconds; 0 if there is none.

    A program may have added a constant to what its clock read.
    """
    if len(stamps) < ENOUGH:
        return 0.0
    for counted in COUNTED_S:
        parts = (stamps - stamps[0]) / counted
        whole = np.round(parts)
        if np.abs(parts - whole).max() < WHOLE:
            unit = counted * int(np.gcd.reduce(whole.astype(np.int64)))
            return unit if LEAST_S <= unit <= MOST_S else 0.0
    return 0.0


def are_milliseconds(stamps: FloatArray) -> bool:
    """Return whether each is a whole number of them: then that is what their clock counts in."""
    parts = stamps / MILLISECOND
    blur = float(np.spacing(np.abs(stamps).max(initial=1.0))) / MILLISECOND
    return bool(np.abs(parts - np.round(parts)).max() < MILLISECOND + blur)
