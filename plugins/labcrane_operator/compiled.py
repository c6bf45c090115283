"""Compiled operator: the aimer's ticks, operation by operation, but for those that plan."""

import math
from collections.abc import Callable

from labcrane import FloatArray
from labcrane.core import Places, compiled, kernel

# What changes from tick to tick, in the order in which Aimer.numbers puts it.
DOING, TIME, WAIT, PRESS, NOISE, LEFT = 0, 1, 2, 3, 4, 7
CHANGING = 8
# What changes with a plan.
PLANNED, DURATION, START, WAY, TO = 8, 9, 10, 13, 16
# What the operator is.
DT, GAIN, STILL, STILL2, MOTOR, PATIENCE, LOOK, INSIDE, SHARE, FRESH = range(19, 29)
# Where things are: axes, then within the state and the task.
LEFT_ON, RIGHT_ON, TRIGGER, TIP, VELOCITY, TARGET, RADIUS = range(29, 36)
ASKED = 36
"""Three numbers to ask the controller with; motor noise that was drawn follows."""
DRAWN = 39

REACTING, MOVING, LOOKING, HOLDING = 2.0, 3.0, 4.0, 5.0
"""Values of :class:`labcrane_operator.aimer.Doing`."""


@compiled.read
def hands(
    own: FloatArray, places: Places, seen: FloatArray, row: FloatArray, inverse: Callable[..., int],
    theirs: FloatArray,
) -> int:  # fmt: skip
    """Make the axes of a tick; decline to plan, and to draw noise."""
    state, task = places[kernel.STATE], places[kernel.TASK]
    tip, velocity = state + int(own[TIP]), state + int(own[VELOCITY])
    x, y, z = seen[tip], seen[tip + 1], seen[tip + 2]
    moving = True
    if own[DOING] != MOVING:
        own[WAIT] -= own[DT]
        target = task + int(own[TARGET])
        ex, ey, ez = x - seen[target], y - seen[target + 1], z - seen[target + 2]
        off = math.sqrt(ex * ex + ey * ey + ez * ez)
        inside = off <= own[INSIDE] * seen[task + int(own[RADIUS])]
        if own[DOING] == HOLDING:
            own[PRESS] -= own[DT]
            if not inside:
                return kernel.DECLINED
            moving = False
        elif own[DOING] == REACTING:
            if own[WAIT] <= 0.0:
                return kernel.DECLINED
            moving = False
        elif own[DOING] == LOOKING and own[WAIT] <= 0.0:
            if not inside:
                return kernel.DECLINED
            vx, vy, vz = seen[velocity], seen[velocity + 1], seen[velocity + 2]
            if math.sqrt(vx * vx + vy * vy + vz * vz) < own[STILL]:
                own[DOING] = HOLDING
                moving = False
    axes = row[places[kernel.AXES] : places[kernel.COMMAND]]
    axes[:] = 0.0
    if moving and own[PLANNED] != 0.0:
        vx = vy = vz = 0.0
        u = own[TIME] / own[DURATION]
        if u >= 1.0:
            px, py, pz = own[TO], own[TO + 1], own[TO + 2]
        else:
            share = u * u * u * (10.0 + u * (6.0 * u - 15.0))
            rest = 1.0 - u
            pace = 30.0 * u * u * rest * rest / own[DURATION]
            px = own[START] + share * own[WAY]
            py = own[START + 1] + share * own[WAY + 1]
            pz = own[START + 2] + share * own[WAY + 2]
            vx, vy, vz = pace * own[WAY], pace * own[WAY + 1], pace * own[WAY + 2]
        ex, ey, ez = px - x, py - y, pz - z
        pace = 2.0 - 2.0 * math.sqrt(ex * ex + ey * ey + ez * ez) / own[PATIENCE]
        if pace > 1.0:
            pace = 1.0
        elif not pace > 0.0:
            pace = 0.0
        if own[DOING] == MOVING:
            own[TIME] += pace * own[DT]
            if own[TIME] >= own[DURATION]:
                own[DOING], own[WAIT] = LOOKING, own[LOOK]
        gain = own[GAIN]
        vx, vy, vz = pace * vx + gain * ex, pace * vy + gain * ey, pace * vz + gain * ez
        if not (vx * vx + vy * vy + vz * vz < own[STILL2] and own[DOING] == LOOKING):
            if own[LEFT] < 1.0:
                return kernel.DECLINED
            own[LEFT] -= 1.0
            drawn, sd = DRAWN + 3 * int(own[LEFT]), own[MOTOR]
            for k in range(3):
                own[NOISE + k] = own[SHARE] * own[NOISE + k] + own[FRESH] * own[drawn + k]
            own[ASKED] = vx * (1.0 + sd * own[NOISE])
            own[ASKED + 1] = vy * (1.0 + sd * own[NOISE + 1])
            own[ASKED + 2] = vz * (1.0 + sd * own[NOISE + 2])
            if inverse(theirs, places, own[ASKED : ASKED + 3], seen, row) != kernel.MADE:
                return kernel.DECLINED
    axes[int(own[LEFT_ON])] = 1.0
    axes[int(own[RIGHT_ON])] = 1.0
    if own[DOING] == HOLDING and own[PRESS] > 0.0:
        axes[int(own[TRIGGER])] = 1.0
    return kernel.MADE
