"""Units of coarse clocks: what stamps are whole multiples of, and ticks that lie behind these.

A program may tell the ticks of its timer in whole milliseconds, which are none of the timer's, and
a number of 32 bits cuts stamps to a power of two.
"""

import numpy as np

from labcrane.types import FloatArray

MILLISECOND = 1e-3
WINDOWS_S = 1.0 / 64.0
USUAL_S = (1.0, 0.1, 1.0 / 60.0, WINDOWS_S, 0.01, MILLISECOND)
"""What programs, screens, Windows and Linux count time in: few stamps show it."""

LEAST_S, MOST_S = 5e-5, 0.04
"""Finer units are reported unchanged; no timer ticks in coarser ones."""

TOLD_S = 1e-6
"""Many programs tell their stamps in this."""

MANY = 2000
"""So many different steps show what all of them are multiples of."""

SEVERAL = 4.0
"""A tick is longer than the unit that it is expressed in, by so much at least."""

NEARLY = 0.01
"""A tick so near to a part of the period is the sampler's."""

WHOLE = 1e-3
FEW = 0.25
"""What is blurred by more than this part of a unit tells nothing of it."""


def find(stamps: FloatArray) -> float:
    """Return the unit of which stamps are whole ones apart, in seconds; 0 if there is none.

    A program may have added a constant to what its clock read.
    """
    blur = 4.0 * float(np.spacing(np.abs(stamps).max(initial=1.0)))
    unit = usual(stamps)
    if unit > MOST_S:
        return unit
    for told in (blur, max(blur, TOLD_S)):
        unit = _common(_steps(stamps, told), 2.0 * told)
        if unit >= LEAST_S:
            unit = _refined(stamps, unit, WHOLE + 2.0 * told / unit)
            if LEAST_S <= unit <= MOST_S:
                return unit
    return 0.0


def usual(stamps: FloatArray) -> float:
    """Return the usual unit, as :func:`find` does of others; 0 if there is none.

    Stamps that are nearly whole ones may be a schedule, which nothing keeps to a microsecond.
    """
    blur = 4.0 * float(np.spacing(np.abs(stamps).max(initial=1.0)))
    for unit in USUAL_S:
        rest = _rest((stamps - stamps[0]) / unit).max()
        if blur < 0.1 * unit and rest < (TOLD_S + blur) / unit:
            return unit
    return 0.0


def are_milliseconds(stamps: FloatArray) -> bool:
    """Return whether each is a whole number of them: then that is what their clock counts in."""
    blur = float(np.spacing(np.abs(stamps).max(initial=1.0)))
    return bool(_rest(stamps / MILLISECOND).max() < WHOLE + blur / MILLISECOND)


def tick(stamps: FloatArray, unit: float, period: float) -> float:
    """Return the ticks that are expressed in a coarse unit; the unit where it is the tick.

    Parameters
    ----------
    stamps
        Of whole ``unit``, in seconds, shape ``(n,)``.
    unit
        In seconds.
    period
        Of a regular stream; 0 of others.
    """
    for longer in (_common(_steps(stamps, unit / 2.0), 1.01 * unit), WINDOWS_S):
        if not SEVERAL * unit < longer <= MOST_S:
            continue
        found = _refined(stamps, longer, 1.05 * unit / longer)
        parts = period / found if found else 0.0
        by_sampler = period > 0.0 and abs(parts - max(round(parts), 1)) < NEARLY * max(parts, 1.0)
        if found and not by_sampler:
            return found
    return unit


def _steps(stamps: FloatArray, blur: float) -> FloatArray:
    """Return the different steps between neighbours, the shortest first."""
    steps = np.abs(np.diff(stamps))
    steps = np.sort(steps[(steps > blur) & (steps < 1.0)])
    if not len(steps):
        return steps
    return np.asarray(steps[np.r_[True, np.diff(steps) > blur]])[:MANY]


def _common(steps: FloatArray, blur: float) -> float:
    """Return what all steps are multiples of, by more than they are blurred; 0 if nothing.

    The longer a step is, the better it tells what it is a multiple of, if it is known of which.
    """
    common, doubt = (float(steps[0]) if len(steps) else 0.0), blur
    for step in map(float, steps):
        longer, shorter = step, common
        while True:
            parts = round(longer / shorter)
            allowed = blur + doubt * parts
            if allowed > FEW * shorter:
                break  # too long to tell
            rest = abs(longer - parts * shorter)
            if rest <= allowed:
                if parts * blur and shorter == common and blur / parts < doubt:
                    common, doubt = longer / parts, blur / parts
                else:
                    common = shorter
                break
            longer, shorter, doubt = shorter, rest, allowed
            if shorter < LEAST_S:
                return 0.0
    return common


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
