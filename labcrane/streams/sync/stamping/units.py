"""Units of coarse clocks: what stamps are whole multiples of, and ticks that lie behind these.

A program may tell the ticks of its timer in whole milliseconds, which are none of the timer's, and
a number of 32 bits cuts stamps to a power of two.
"""

import numpy as np

from labcrane.types import FloatArray

DECIMAL_S = (1.0, 0.1)
LEAST_S, MOST_S = 5e-5, 0.04
"""Finer units are reported unchanged; no timer ticks in coarser ones."""

TOLD_S = 1e-6
"""Many programs tell their stamps in this."""

MANY = 2000
"""So many different steps show what all of them are multiples of."""

WHOLE = 1e-3


def find(stamps: FloatArray) -> float:
    """Return the unit of which stamps are whole ones apart, in seconds; 0 if there is none.

    A program may have added a constant to what its clock read.
    """
    blur = 4.0 * float(np.spacing(np.abs(stamps).max(initial=1.0)))
    for unit in DECIMAL_S:
        if blur < 0.1 * unit and _rest((stamps - stamps[0]) / unit).max() < WHOLE + blur / unit:
            return unit
    for told in (blur, max(blur, TOLD_S)):
        unit = _common(_steps(stamps, told), 2.0 * told)
        if unit >= LEAST_S:
            unit = _refined(stamps, unit, WHOLE + 2.0 * told / unit)
            if LEAST_S <= unit <= MOST_S:
                return unit
    return 0.0


def _steps(stamps: FloatArray, blur: float) -> FloatArray:
    """Return the different steps between neighbours, the shortest first."""
    steps = np.abs(np.diff(stamps))
    steps = np.sort(steps[(steps > blur) & (steps < 1.0)])
    if not len(steps):
        return steps
    return np.asarray(steps[np.r_[True, np.diff(steps) > blur]])[:MANY]


def _common(steps: FloatArray, blur: float) -> float:
    """Return the least by which steps differ from each other or from none; 0 without steps."""
    if not len(steps):
        return 0.0
    apart = np.diff(steps)
    return float(min(steps[0], apart[apart > blur].min(initial=np.inf)))


def _refined(stamps: FloatArray, unit: float, nearly: float) -> float:
    """Return the unit that all stamps are nearly whole ones of; 0 if there is none.

    By ever more of them, so that what is known of it suffices to count on.
    """
    away, count = stamps - stamps[0], 16
    while True:
        some = away[:count]
        parts = np.round(some / unit)
        if np.ptp(parts) > 0.0:
            slope, level = np.polyfit(parts, some, 1)
            if not slope > 0.0 or np.abs((some - level) / slope - parts).max() > nearly:
                return 0.0
            unit = float(slope)
        if count >= len(away):
            return unit
        count = min(2 * count, len(away))


def _rest(parts: FloatArray) -> FloatArray:
    return np.asarray(np.abs(parts - np.round(parts)))
