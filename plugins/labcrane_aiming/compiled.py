"""Compiled task: the ticks of a movement in which nothing is to be told."""

import math

from labcrane import FloatArray
from labcrane.core import Places, compiled, twin

RESTS_SINCE, INSIDE, ENTRIES, PRESSED, FAST = range(5)
CHANGING = 5
COMMANDED, REST_SPEED, REST, LIMIT, HALF, RULE, TRIGGER, AFTER, TIP, VELOCITY, FIRST, LAST = range(
    5, 17
)
ONSET_SPEED = 17
SHOWN = 18
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


@compiled.tick
def evaluate(own: FloatArray, places: Places, seen: FloatArray, row: FloatArray) -> int:
    """Judge a tick; decline one with an event, or that may end the trial."""
    state, task, rule = places[twin.STATE], places[twin.TASK], own[RULE]
    tip, velocity = state + int(own[TIP]), state + int(own[VELOCITY])
    elapsed = row[twin.ELAPSED]
    vx, vy, vz = row[velocity], row[velocity + 1], row[velocity + 2]
    speed = math.sqrt(vx * vx + vy * vy + vz * vz)
    ex = row[tip] - own[SHOWN]
    ey = row[tip + 1] - own[SHOWN + 1]
    ez = row[tip + 2] - own[SHOWN + 2]
    inside = math.sqrt(ex * ex + ey * ey + ez * ez) <= own[HALF]
    entered = inside and own[INSIDE] == 0.0
    own[INSIDE] = 1.0 if inside else 0.0
    if speed >= own[REST_SPEED] or not (inside or rule != REST_INSIDE):
        own[RESTS_SINCE] = math.nan
    elif math.isnan(own[RESTS_SINCE]):
        own[RESTS_SINCE] = elapsed
    if speed > own[ONSET_SPEED]:
        own[FAST] = 1.0
    if own[COMMANDED] == 0.0:
        for k in range(
            places[twin.COMMAND] + int(own[FIRST]), places[twin.COMMAND] + int(own[LAST])
        ):
            if row[k] != 0.0:
                return twin.DECLINED
    if entered:
        own[ENTRIES] += 1.0
        if own[ENTRIES] == 1.0:
            return twin.DECLINED
    if rule == BY_TRIGGER:
        pressed = row[places[twin.AXES] + int(own[TRIGGER])] > 0.5  # noqa: PLR2004 - as in the class
        if pressed and own[PRESSED] == 0.0:
            return twin.DECLINED
        own[PRESSED] = 1.0 if pressed else 0.0
    elif elapsed - own[RESTS_SINCE] >= own[REST] and (
        # Before the tip was fast there is no onset; of others the task itself decides.
        rule == REST_INSIDE
        or ((inside or own[FAST] != 0.0) and _done(own, row, tip) >= own[AFTER] - ROUNDING)
    ):
        return twin.DECLINED
    if elapsed >= own[LIMIT]:
        return twin.DECLINED
    row[task : places[twin.END]] = own[SHOWN : SHOWN + places[twin.END] - task]
    return twin.MADE
