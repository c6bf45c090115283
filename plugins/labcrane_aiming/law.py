"""Law of the task: when the tip rests, when a movement begins, and how far it is, in scalars.

The movement calls it tick by tick, and so does the kernel, which is compiled for simulations.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from labcrane.core import kernel

if TYPE_CHECKING:  # a protocol is checked without loading numpy
    from collections.abc import Sequence

    from labcrane import FloatArray
    from labcrane.core import Places

    Numbers = Sequence[float] | FloatArray

RESTS_SINCE, INSIDE, ENTRIES, PRESSED, FAST_SINCE, HANDS_OFF = range(6)
CHANGING = 6
BEGUN, COMMANDED, REACTED, REST_SPEED, REST, LIMIT, HALF, RULE, TRIGGER, AFTER = range(6, 16)
TIP, VELOCITY, FIRST, LAST, ONSET_SPEED, ONSET_HOLD, STARTED, START_DISTANCE = range(16, 24)
SHOWN = 24
"""The task's signals: target, radius and where the movement comes from."""

END_RULES = ("rest_inside", "rest_anywhere", "trigger")
REST_INSIDE, BY_TRIGGER = 0.0, 2.0
"""Their numbers."""
PRESS = 0.5
"""Above it a button is pressed, which is 0 or 1."""


def size(x: float, y: float, z: float) -> float:
    """Return a vector's length: a root of squares, not dist, which Python 3.12 rounds otherwise."""
    return math.sqrt(x * x + y * y + z * z)


def since(before: float, elapsed: float, holds: bool) -> float:  # noqa: FBT001 - numba has no keywords
    """Return since when something has held in every tick, in s; NaN if it does not now."""
    if not holds:
        return math.nan
    return elapsed if math.isnan(before) else before


def begins(
    fast_since: float, elapsed: float, hold: float, started: float, nearer: float, half: float
) -> bool:
    """Return whether the onset is known from this tick on.

    The onset is the first tick of the first stretch in which the tip is faster than the onset
    speed for long enough, however fast it becomes later. What was fast already when the trial
    began may be how the movement before runs out: that has begun once it has come nearer to the
    target by the circle's radius.
    """
    if fast_since == started:
        return nearer >= half
    return elapsed - fast_since >= hold


def done(tip: Numbers, target: Numbers, start: Numbers) -> float:
    """Return the fraction of the way from circle to circle that is made along the task axis."""
    along = length2 = 0.0
    for k in range(3):
        axis = target[k] - start[k]
        along += (tip[k] - start[k]) * axis
        length2 += axis * axis
    return along / length2


def evaluate(own: FloatArray, places: Places, seen: FloatArray, row: FloatArray) -> int:
    """Judge a tick; decline one with an event, or that may end the trial."""
    state, task, rule = places[kernel.STATE], places[kernel.TASK], own[RULE]
    at, velocity = state + int(own[TIP]), state + int(own[VELOCITY])
    tip, target, start = row[at : at + 3], own[SHOWN : SHOWN + 3], own[SHOWN + 4 : SHOWN + 7]
    elapsed = row[kernel.ELAPSED]
    speed = size(row[velocity], row[velocity + 1], row[velocity + 2])
    distance = size(tip[0] - target[0], tip[1] - target[1], tip[2] - target[2])
    inside = distance <= own[HALF]
    entered = inside and own[INSIDE] == 0.0
    own[INSIDE] = 1.0 if inside else 0.0
    rests = speed < own[REST_SPEED] and (inside or rule != REST_INSIDE)
    own[RESTS_SINCE] = since(own[RESTS_SINCE], elapsed, rests)
    if own[BEGUN] == 0.0:
        own[FAST_SINCE] = since(own[FAST_SINCE], elapsed, speed > own[ONSET_SPEED])
        nearer = own[START_DISTANCE] - distance
        if begins(own[FAST_SINCE], elapsed, own[ONSET_HOLD], own[STARTED], nearer, own[HALF]):
            return kernel.DECLINED
    if own[REACTED] == 0.0:
        given = False
        for k in range(
            places[kernel.COMMAND] + int(own[FIRST]), places[kernel.COMMAND] + int(own[LAST])
        ):
            given = given or row[k] != 0.0
        if given and (own[COMMANDED] == 0.0 or own[HANDS_OFF] != 0.0):
            return kernel.DECLINED
        if not given:
            own[HANDS_OFF] = 1.0
    if entered:
        own[ENTRIES] += 1.0
        if own[ENTRIES] == 1.0:
            return kernel.DECLINED
    if rule == BY_TRIGGER:
        pressed = row[places[kernel.AXES] + int(own[TRIGGER])] > PRESS
        if pressed and own[PRESSED] == 0.0:
            return kernel.DECLINED
        own[PRESSED] = 1.0 if pressed else 0.0
    elif elapsed - own[RESTS_SINCE] >= own[REST] and (
        rule == REST_INSIDE
        or ((inside or own[BEGUN] != 0.0) and done(tip, target, start) >= own[AFTER])
    ):
        return kernel.DECLINED
    if elapsed >= own[LIMIT]:
        return kernel.DECLINED
    row[task : places[kernel.END]] = own[SHOWN : SHOWN + places[kernel.END] - task]
    return kernel.MADE
