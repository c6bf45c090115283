"""Law of the hands: what they do in a tick, and the tip velocity that they ask for, in scalars.

All that changes, and all that it depends on, is in one array of numbers. The functions run as they
are on a list, and compiled on an array.
"""

import math
from collections.abc import Callable

from labcrane import FloatArray
from labcrane.core import Places, kernel

Numbers = list[float] | FloatArray

# What changes from tick to tick.
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
BLOCK = 512
"""Ticks of motor noise drawn at once; one call a tick would cost more than the plan."""

WAITING, REACTING, MOVING, LOOKING, HOLDING = 1.0, 2.0, 3.0, 4.0, 5.0
"""What the operator is at: waiting for a target, reacting to one just seen, moving along a plan,
looking at where the plan ended, or at rest inside the target."""

STANDS, GOES, PLANS, DRAWS = range(4)
"""What the hands do in a tick: nothing, follow the plan, or first plan or draw noise."""


def look(own: Numbers, off: float, speed: float, radius: float) -> int:
    """Return what the hands do with the tip so far off the target, in m, and so fast, in m/s."""
    if own[DOING] == MOVING:
        return GOES
    own[WAIT] -= own[DT]
    inside = off <= own[INSIDE] * radius
    if own[DOING] == HOLDING:
        own[PRESS] -= own[DT]
        return STANDS if inside else PLANS
    if own[DOING] == REACTING:
        return STANDS if own[WAIT] > 0.0 else PLANS
    if own[DOING] == LOOKING and own[WAIT] <= 0.0:
        if not inside:
            return PLANS
        if speed < own[STILL]:
            own[DOING] = HOLDING
            return STANDS
    return GOES


def follow(own: Numbers, x: float, y: float, z: float) -> int:
    """Ask for a velocity along the plan and towards it, with the hands' noise, from a tip in m.

    The plan is the straight movement of least jerk (Flash and Hogan 1985). Its pace is below 1 when
    the machine lags behind; a machine that an assistant has brought ahead is not waited for.
    """
    if own[PLANNED] == 0.0:
        return STANDS
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
    pace = 1.0
    if ex * own[WAY] + ey * own[WAY + 1] + ez * own[WAY + 2] > 0.0:
        pace = 2.0 - 2.0 * math.sqrt(ex * ex + ey * ey + ez * ez) / own[PATIENCE]
        pace = 1.0 if pace > 1.0 else pace if pace > 0.0 else 0.0
    if own[DOING] == MOVING:
        own[TIME] += pace * own[DT]
        if own[TIME] >= own[DURATION]:
            own[DOING], own[WAIT] = LOOKING, own[LOOK]
    gain = own[GAIN]
    vx, vy, vz = pace * vx + gain * ex, pace * vy + gain * ey, pace * vz + gain * ez
    if vx * vx + vy * vy + vz * vz < own[STILL2] and own[DOING] == LOOKING:
        return STANDS
    if own[LEFT] < 1.0:
        return DRAWS
    own[LEFT] -= 1.0
    drawn, sd = DRAWN + 3 * int(own[LEFT]), own[MOTOR]
    for k in range(3):
        own[NOISE + k] = own[SHARE] * own[NOISE + k] + own[FRESH] * own[drawn + k]
    own[ASKED] = vx * (1.0 + sd * own[NOISE])
    own[ASKED + 1] = vy * (1.0 + sd * own[NOISE + 1])
    own[ASKED + 2] = vz * (1.0 + sd * own[NOISE + 2])
    return GOES


def presses(own: Numbers) -> bool:
    """Return whether the trigger is pressed now."""
    return own[DOING] == HOLDING and own[PRESS] > 0.0


def hands(
    own: FloatArray, places: Places, seen: FloatArray, row: FloatArray, inverse: Callable[..., int],
    theirs: FloatArray,
) -> int:  # fmt: skip
    """Make the axes of a tick; decline to plan, and to draw noise."""
    state, task = places[kernel.STATE], places[kernel.TASK]
    tip, velocity = state + int(own[TIP]), state + int(own[VELOCITY])
    target = task + int(own[TARGET])
    x, y, z = seen[tip], seen[tip + 1], seen[tip + 2]
    ex, ey, ez = x - seen[target], y - seen[target + 1], z - seen[target + 2]
    vx, vy, vz = seen[velocity], seen[velocity + 1], seen[velocity + 2]
    off = math.sqrt(ex * ex + ey * ey + ez * ez)
    speed = math.sqrt(vx * vx + vy * vy + vz * vz)
    does = look(own, off, speed, seen[task + int(own[RADIUS])])
    if does == GOES:
        does = follow(own, x, y, z)
    axes = row[places[kernel.AXES] : places[kernel.COMMAND]]
    axes[:] = 0.0
    if does == GOES:
        if inverse(theirs, places, own[ASKED : ASKED + 3], seen, row) != kernel.MADE:
            return kernel.DECLINED
    elif does != STANDS:
        return kernel.DECLINED
    axes[int(own[LEFT_ON])] = 1.0
    axes[int(own[RIGHT_ON])] = 1.0
    if presses(own):
        axes[int(own[TRIGGER])] = 1.0
    return kernel.MADE
