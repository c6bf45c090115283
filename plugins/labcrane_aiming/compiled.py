"""Compiled task: the ticks of a movement without an event."""

import math

from labcrane import FloatArray
from labcrane.core import Places, compiled, kernel

RESTS_SINCE, INSIDE, ENTRIES, PRESSED, FAST_SINCE, HANDS_OFF = range(6)
CHANGING = 6
BEGUN, COMMANDED, REACTED, REST_SPEED, REST, LIMIT, HALF, RULE, TRIGGER, AFTER = range(6, 16)
TIP, VELOCITY, FIRST, LAST, ONSET_SPEED, ONSET_HOLD, STARTED, START_DISTANCE = range(16, 24)
SHOWN = 24
"""The task's signals: target, radius and where the movement comes from."""

REST_INSIDE, REST_ANYWHERE, BY_TRIGGER = range(3)
"""End rules."""

ROUNDING = 1e-9


@compiled.part
def _done(own: FloatArray, row: FloatArray, tip: int) -> float:
    """Return the fraction of the way that is made; the task itself decides when it is close."""
    along = length2 = 0.0
    for k in range(3):
        axis = own[SHOWN + k] - own[SHOWN + 4 + k]
        along += (row[tip + k] - own[SHOWN + 4 + k]) * axis
        length2 += axis * axis
    return along / length2


@compiled.part
def _begins(own: FloatArray, elapsed: float, speed: float, distance: float) -> bool:
    """Return whether the onset is known from this tick on, as the task looks for it."""
    if not speed > own[ONSET_SPEED]:
        own[FAST_SINCE] = math.nan
        return False
    if math.isnan(own[FAST_SINCE]):
        own[FAST_SINCE] = elapsed
    if own[FAST_SINCE] == own[STARTED]:
        return bool(own[START_DISTANCE] - distance >= own[HALF])
    return bool(elapsed - own[FAST_SINCE] >= own[ONSET_HOLD])


@compiled.tick
def evaluate(own: FloatArray, places: Places, seen: FloatArray, row: FloatArray) -> int:
    """Judge a tick; decline one with an event, or that may end the trial."""
    state, task, rule = places[kernel.STATE], places[kernel.TASK], own[RULE]
    tip, velocity = state + int(own[TIP]), state + int(own[VELOCITY])
    elapsed = row[kernel.ELAPSED]
    vx, vy, vz = row[velocity], row[velocity + 1], row[velocity + 2]
    speed = math.sqrt(vx * vx + vy * vy + vz * vz)
    ex = row[tip] - own[SHOWN]
    ey = row[tip + 1] - own[SHOWN + 1]
    ez = row[tip + 2] - own[SHOWN + 2]
    distance = math.sqrt(ex * ex + ey * ey + ez * ez)
    inside = distance <= own[HALF]
    entered = inside and own[INSIDE] == 0.0
    own[INSIDE] = 1.0 if inside else 0.0
    if speed >= own[REST_SPEED] or not (inside or rule != REST_INSIDE):
        own[RESTS_SINCE] = math.nan
    elif math.isnan(own[RESTS_SINCE]):
        own[RESTS_SINCE] = elapsed
    if own[BEGUN] == 0.0 and _begins(own, elapsed, speed, distance):
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
        pressed = row[places[kernel.AXES] + int(own[TRIGGER])] > 0.5  # noqa: PLR2004 - as in the class
        if pressed and own[PRESSED] == 0.0:
            return kernel.DECLINED
        own[PRESSED] = 1.0 if pressed else 0.0
    elif elapsed - own[RESTS_SINCE] >= own[REST] and (
        rule == REST_INSIDE
        or ((inside or own[BEGUN] != 0.0) and _done(own, row, tip) >= own[AFTER] - ROUNDING)
    ):
        return kernel.DECLINED
    if elapsed >= own[LIMIT]:
        return kernel.DECLINED
    row[task : places[kernel.END]] = own[SHOWN : SHOWN + places[kernel.END] - task]
    return kernel.MADE
